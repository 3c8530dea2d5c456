"""Where is the lamp, and what colour has the ball? Adam, an optimiser of PyTorch, finds both in a picture."""

import visray as vr  # isort: skip - first, because it chooses the LLVM that Dr.Jit loads
import torch

floor, ball = vr.Plane(point=(0.0, -1.0, 0.0), material="paper"), vr.Sphere(radius=0.9, material="paint")
scene = vr.Scene(
    camera=vr.Camera(origin=(0.0, 2.0, 6.0), fov=28.0), film=vr.Film(width=48, height=32), ambient=(0.2, 0.2, 0.2),
    materials={"paint": vr.Material(kd=(0.7, 0.3, 0.15)), "paper": vr.Material()},
    lights={"lamp": vr.PointLight(position=(3.0, 4.0, 2.0))}, objects={"floor": floor, "ball": ball},
    settings=vr.Settings(spp=4, shadows=False),
)  # fmt: skip
render = vr.render_function(scene, ["materials.paint.kd", "lights.lamp.position"])
target = torch.tensor(render(*render.start), dtype=torch.float32)

kd, position = torch.tensor([0.4, 0.4, 0.4], requires_grad=True), torch.tensor([-1.0, 3.0, 4.0], requires_grad=True)
steps = torch.optim.Adam([{"params": [kd], "lr": 0.02}, {"params": [position], "lr": 0.1}])
for i in range(200):
    loss = ((render(kd, position) - target) ** 2).mean()
    if i % 50 == 0:
        print(f"step {i}: loss {loss.item():.2e}")
    steps.zero_grad()
    loss.backward()
    steps.step()
    kd.data.clamp_(0, 1)
print("found", [round(x, 2) for x in (*kd.tolist(), *position.tolist())], "made with 0.7 0.3 0.15 3 4 2")
