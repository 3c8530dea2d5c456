import visray as vr

objects = {
    "ground": vr.Plane(material="grass"),
    "base": vr.Box(min=(-5, 0, -3), max=(5, 0.5, 3), material="marble"),
    "roof": vr.Box(min=(-4.8, 4.5, -2.8), max=(4.8, 5.2, 2.8), material="marble"),
    "cella": vr.Box(min=(-2.5, 0.5, -1.2), max=(2.5, 4.5, 1.2), material="marble"),
}
for i in range(6):
    for name, z in (("back", -2.3), ("front", 2.3)):
        x = -4.25 + 1.7 * i
        objects[f"{name} column {i}"] = vr.Cylinder(center=(x, 2.5, z), radius=0.35, height=4, material="marble")
scene = vr.Scene(
    materials={"marble": vr.Material(kd=(0.85, 0.8, 0.7)), "grass": vr.Material(kd=(0.15, 0.35, 0.08))}, objects=objects
)
