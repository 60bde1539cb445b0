import numpy as np
import pytest

from station.twin.fruit import VARIETIES, Kind, draw_fruit

FRUIT = ["strawberry", "raspberry", "blueberry"]


@pytest.mark.parametrize("kind", FRUIT)
def test_sizes_have_the_mean_spread_and_correlation_of_the_papers_fruit(kind, paper_samples):
    real = paper_samples[kind]
    drawn = np.array([(f.weight_g, f.length_mm, f.width_mm) for f in (draw_fruit(kind, seed) for seed in range(1500))])
    spread = real.std(axis=0, ddof=1)
    assert (np.abs(drawn.mean(axis=0) - real.mean(axis=0)) < 0.1 * spread).all()
    assert drawn.std(axis=0) == pytest.approx(spread, rel=0.08)
    assert np.corrcoef(drawn.T) == pytest.approx(np.corrcoef(real.T), abs=0.08)
    assert drawn.min() > 0


@pytest.mark.parametrize("kind", list(Kind))
def test_the_same_seed_draws_the_same_fruit(kind):
    assert draw_fruit(kind, 7) == draw_fruit(kind, 7)
    if VARIETIES[kind].spread[2]:
        assert draw_fruit(kind, 7) != draw_fruit(kind, 8)


@pytest.mark.parametrize("kind", list(Kind))
def test_a_surface_stands_behind_its_foremost_point_everywhere(kind):
    fruit = draw_fruit(kind, 3)
    y, x = np.meshgrid(np.linspace(-8, 8, 81), np.linspace(-6, 6, 61), indexing="ij")
    gap = fruit.gap_mm(x.astype(np.float32), y.astype(np.float32))
    texture = fruit.texture_mm(x.astype(np.float32), y.astype(np.float32))
    assert gap[40, 30] == pytest.approx(0.0, abs=1e-6)
    assert (np.diff(gap[40, 30:]) > 0).all()
    assert texture.min() >= 0
    assert texture.max() < 2.0


def test_a_strawberry_has_seeds_a_raspberry_drupelets_and_a_ball_nothing():
    y, x = (
        grid.astype(np.float32) for grid in np.meshgrid(np.arange(-6, 6, 0.1), np.arange(-6, 6, 0.1), indexing="ij")
    )
    depth = {kind: draw_fruit(kind, 0).texture_mm(x, y).std() for kind in Kind}
    assert depth[Kind.RASPBERRY] > depth[Kind.STRAWBERRY] > 0.02
    assert depth[Kind.RUBBER_BALL] == depth[Kind.TEST_SPHERE] == 0


def test_an_unknown_kind_is_refused():
    with pytest.raises(ValueError, match="gooseberry"):
        draw_fruit("gooseberry", 0)
