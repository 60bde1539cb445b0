"""Confidence interval of a rate that was counted."""


def clopper_pearson(count: int, of: int) -> tuple[float, float]:
    """Return the 95 % interval of a rate (Clopper and Pearson, Biometrika 26 (1934) 404): never too narrow.

    Args:
        count: number of cases.
        of: number of independent trials, at least 1.
    """
    from scipy.special import betaincinv  # noqa: PLC0415 (it takes long to load, and each start of the pages waits)

    low = float(betaincinv(count, of - count + 1, 0.025)) if count else 0.0
    high = float(betaincinv(count + 1, of - count, 0.975)) if count < of else 1.0
    return low, high
