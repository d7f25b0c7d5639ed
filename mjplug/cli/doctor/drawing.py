"""Renders a small image with one OpenGL backend. It runs in a separate process, because a broken driver may crash it.

Run as `python -m mjplug.cli.doctor.drawing BACKEND`; prints the name of the renderer.
"""

import importlib
import os
import sys

_SIZE = 32
_SCENE = """
<mujoco>
  <visual><global offwidth="32" offheight="32"/></visual>
  <worldbody><light pos="0 0 3"/><geom type="sphere" size=".5" rgba="1 0 0 1"/></worldbody>
</mujoco>
"""


def main(backend: str) -> int:
    """Returns 0 if the image is correct."""
    # If libraries of the backend are missing, this variable would make the import of MuJoCo fail.
    os.environ.pop("MUJOCO_GL", None)
    os.environ["PYOPENGL_PLATFORM"] = "" if backend == "glfw" else backend
    import mujoco
    import numpy as np

    context = importlib.import_module(f"mujoco.{backend}").GLContext(_SIZE, _SIZE)
    context.make_current()
    model = mujoco.MjModel.from_xml_string(_SCENE)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    scene, camera = mujoco.MjvScene(model, maxgeom=10), mujoco.MjvCamera()
    mujoco.mjv_defaultFreeCamera(model, camera)
    drawing = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
    mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, drawing)
    every = mujoco.mjtCatBit.mjCAT_ALL
    mujoco.mjv_updateScene(model, data, mujoco.MjvOption(), None, camera, every.value, scene)
    picture = np.zeros((_SIZE, _SIZE, 3), np.uint8)
    area = mujoco.MjrRect(0, 0, _SIZE, _SIZE)
    mujoco.mjr_render(area, scene, drawing)
    mujoco.mjr_readPixels(picture, None, area, drawing)
    renderer = importlib.import_module("OpenGL.GL").glGetString(0x1F01)
    red, green, _ = picture[_SIZE // 2, _SIZE // 2]
    context.free()
    if not red > 2 * green:
        print("the rendered image is wrong", file=sys.stderr)
        return 1
    print((renderer or b"unknown renderer").decode(errors="replace"))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
