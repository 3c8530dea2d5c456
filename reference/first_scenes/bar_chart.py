import visray as vr

sales = {"Mon": 3.0, "Tue": 4.5, "Wed": 2.2, "Thu": 5.1, "Fri": 6.0}
bars = {
    day: vr.Box(min=(i, 0, 0), max=(i + 0.7, height, 0.7), material="weekend" if day == "Fri" else "blue")
    for i, (day, height) in enumerate(sales.items())
}
scene = vr.Scene(
    background=(1.0, 1.0, 1.0),
    materials={
        "paper": vr.Material(kd=(0.9, 0.9, 0.9)),
        "blue": vr.Material(kd=(0.1, 0.25, 0.7)),
        "weekend": vr.Material(kd=(0.9, 0.35, 0.05)),
    },
    objects={"paper": vr.Rectangle(center=(2.4, 0, 0.3), width=(7, 0, 0), height=(0, 0, -3), material="paper"), **bars},
)
