from pathlib import Path
def test_shots(orchard, panel):
    out=Path("/tmp/shots"); out.mkdir(exist_ok=True)
    print(orchard.fruit)
    for who in ("", "Quin"):
        p=panel(who)
        for name,path in {"recipes":"/recipes","recipe":"/recipes/strawberry","edit":"/recipes/strawberry/edit","rhist":"/recipes/strawberry/history","rtext":"/recipes/strawberry/text","history":"/history","audit":"/history/audit","insp":"/history/2","step":"/history/2/step/2","m":"/maintenance","hand":"/maintenance/hand","image":"/maintenance/image","sensor":"/maintenance/sensor","reg":"/maintenance/registers","log":"/maintenance/log"}.items():
            r=p.page.goto(p.address+path)
            print(name,r.status)
            p.page.wait_for_timeout(1200 if name in("reg","image") else 300)
            p.page.screenshot(path=str(out/f"{name}{'_'+who if who else ''}.png"),full_page=True)
