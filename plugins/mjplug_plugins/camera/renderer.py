"""Renders the model with one OpenGL context for all cameras."""

from collections.abc import Iterable

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjplug.plugin import UnavailableError
from mjplug_plugins.camera.gl import GlContext, unavailable
from mjplug_plugins.camera.parameters import Quality
from mjplug_plugins.camera.sky import Sky
from mjplug_plugins.camera.translucent import has_translucent, translucent_hidden

_OFFSCREEN = int(mujoco.mjtFramebuffer.mjFB_OFFSCREEN)
_EVERYTHING = int(mujoco.mjtCatBit.mjCAT_ALL)
_SHADOW, _REFLECTION = int(mujoco.mjtRndFlag.mjRND_SHADOW), int(mujoco.mjtRndFlag.mjRND_REFLECTION)
_BY_ID = [int(mujoco.mjtRndFlag.mjRND_SEGMENT), int(mujoco.mjtRndFlag.mjRND_IDCOLOR)]
_HAZE = int(mujoco.mjtRndFlag.mjRND_HAZE)
_SKYBOX = int(mujoco.mjtRndFlag.mjRND_SKYBOX)
_SKY_TEXTURE = int(mujoco.mjtTexture.mjTEXTURE_SKYBOX)
_RANGEFINDER = int(mujoco.mjtVisFlag.mjVIS_RANGEFINDER)
_FONT = int(mujoco.mjtFontScale.mjFONTSCALE_50)
_GEOM = int(mujoco.mjtObj.mjOBJ_GEOM)

_SPARE_GEOMS = 1000
_ID_WEIGHTS = np.array([1, 1 << 8, 1 << 16], np.int32)


class Renderer:
    """Renders one camera at a time. Use it only in the thread that created it.

    Attributes:
        gl: The OpenGL context.

    Args:
        model: A copy for the renderer, which changes its visual settings.
        width: Width of the largest image [pixels].
        height: Height of the largest image [pixels].
        quality: `fast` disables shadows, reflections, haze and multisampling.
        geom_groups: Geom groups that are rendered.
        site_groups: Site groups that are rendered.

    Raises:
        UnavailableError: OpenGL does not work, or cannot render images of this size.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        width: int,
        height: int,
        quality: Quality,
        geom_groups: Iterable[int],
        site_groups: Iterable[int],
    ) -> None:
        self._model = model
        # MuJoCo reads all four values when it creates the context.
        model.vis.global_.offwidth, model.vis.global_.offheight = width, height
        if quality == "fast":
            model.vis.quality.offsamples = model.vis.quality.shadowsize = 0
        self.gl = GlContext(width, height)
        self._context: mujoco.MjrContext | None = None
        try:
            self._context = mujoco.MjrContext(model, _FONT)
            mujoco.mjr_setBuffer(_OFFSCREEN, self._context)
            if (self._context.offWidth, self._context.offHeight) != (width, height):
                raise UnavailableError(f"OpenGL cannot render {width}x{height} pixels on this machine")
        except mujoco.FatalError as error:
            self.close()
            raise unavailable(error) from error
        except UnavailableError:
            self.close()
            raise
        # Reversed depth is more precise: floats have a finer resolution near zero, and zero is the far plane.
        self._context.readDepthMap = int(mujoco.mjtDepthMap.mjDEPTH_ZEROFAR)
        self._smooth = self._context.offSamples > 0
        has_sky = bool(np.any(model.tex_type == _SKY_TEXTURE))
        self._sky = Sky(int(model.vis.quality.numslices)) if has_sky else None
        self._sky_verified: bool | None = None
        self._translucent = has_translucent(model)
        self._scene = mujoco.MjvScene(model, _max_geoms(model))
        if quality == "fast":
            # MuJoCo draws the haze together with the sky, over the objects in front of the sky.
            self._scene.flags[[_SHADOW, _REFLECTION, _HAZE]] = 0
        self._options = mujoco.MjvOption()
        self._options.flags[_RANGEFINDER] = 0
        self._options.geomgroup[:] = np.isin(range(len(self._options.geomgroup)), list(geom_groups))
        self._options.sitegroup[:] = np.isin(range(len(self._options.sitegroup)), list(site_groups))
        self._camera = mujoco.MjvCamera()
        self._camera.type = int(mujoco.mjtCamera.mjCAMERA_FIXED)
        self._rect = mujoco.MjrRect(0, 0, width, height)

    def set_view(self, data: mujoco.MjData, camera: int, width: int, height: int) -> None:
        """Sets up the scene for a camera and an image size [pixels]."""
        self._camera.fixedcamid = camera
        self._rect = mujoco.MjrRect(0, 0, width, height)
        mujoco.mjv_updateScene(self._model, data, self._options, None, self._camera, _EVERYTHING, self._scene)

    def draw(self, colour: NDArray[np.uint8] | None, depth: NDArray[np.float32] | None) -> None:
        """Renders the scene and reads the pixels, bottom row first.

        The depth is that of opaque objects only: translucent objects are ignored, and the sky is background.

        Args:
            colour: Output: red, green and blue, shape (rows, columns, 3); None for no colour image.
            depth: Output: the raw depth buffer, 1 at the near plane and 0 at the far plane and for the background,
                shape (rows, columns); None for no depth image.

        Raises:
            RuntimeError: OpenGL reports an error, or its context was lost.
        """
        # A multisampled depth buffer does not contain the depth at the pixel's centre; rendering by id does.
        if colour is None or depth is None or self._smooth or not self._sky_is_separable():
            if colour is not None:
                self._render(sky=True)
                self._read(colour, None)
            if depth is not None:
                self._render_opaque_by_id()
                self._read(None, depth)
            return
        self._render(sky=True)
        self._read(colour, depth)
        if self._sky is not None:
            # MuJoCo draws the sky as an object with a depth.
            self._sky.erase(self._scene.camera[0], depth)

    def draw_geoms(self, out: NDArray[np.int32]) -> None:
        """Renders the scene and reads the id of the geom in each pixel, bottom row first; -1 for no geom.

        Args:
            out: Output: geom ids, shape (rows, columns).

        Raises:
            RuntimeError: OpenGL reports an error.
        """
        colour = np.empty((*out.shape, 3), np.uint8)
        self._render(by_id=True)
        self._read(colour, None)
        count = self._scene.ngeom
        geoms = np.full(count + 1, -1, np.int32)
        for geom in self._scene.geoms[:count]:
            if geom.objtype == _GEOM and geom.segid >= 0:
                geoms[geom.segid + 1] = geom.objid
        np.take(geoms, colour @ _ID_WEIGHTS, out=out, mode="clip")

    def to_metres(self, depth: NDArray[np.float32]) -> None:
        """Converts raw depths of the last rendering to distances along the optical axis [m], in place."""
        camera = self._scene.camera[0]
        near, far = float(camera.frustum_near), float(camera.frustum_far)
        if camera.orthographic:
            depth *= near - far
            depth += far
        else:
            depth *= 1.0 / near - 1.0 / far
            depth += 1.0 / far
            np.reciprocal(depth, out=depth)

    @property
    def far(self) -> float:
        """Distance of the far plane [m]."""
        return float(self._model.vis.map.zfar * self._model.stat.extent)

    @property
    def truncated(self) -> bool:
        """Whether the last scene contained more objects than fit into its buffer."""
        return bool(self._scene.status)

    def close(self) -> None:
        """Frees the OpenGL objects; a second call does nothing."""
        if self._context is not None:
            self._context.free()
            self._context = None
        self.gl.close()

    def _sky_is_separable(self) -> bool:
        """Whether the depth distinguishes the sky, if the model has one, from the objects in front of it."""
        camera = self._scene.camera[0]
        if self._sky is None:
            return True
        if camera.orthographic:
            return False
        if self._sky_verified is None:
            # Another MuJoCo version may draw the sky differently.
            depth = np.empty((self._rect.height, self._rect.width), np.float32)
            self._scene.ngeom, count = 0, self._scene.ngeom
            self._render(sky=True)
            self._scene.ngeom = count
            self._read(None, depth)
            self._sky_verified = bool(self._sky.mask(camera, depth).all())
        return self._sky_verified

    def _render_opaque_by_id(self) -> None:
        """Renders opaque objects without multisampling, which MuJoCo disables when it renders by id."""
        if not self._translucent:
            self._render(by_id=True)
            return
        with translucent_hidden(self._scene):
            self._render(by_id=True)

    def _render(self, sky: bool = False, by_id: bool = False) -> None:
        self._scene.flags[_SKYBOX] = sky
        self._scene.flags[_BY_ID] = by_id
        mujoco.mjr_render(self._rect, self._scene, self._open_context)

    def _read(self, colour: NDArray[np.uint8] | None, depth: NDArray[np.float32] | None) -> None:
        if depth is not None:
            depth[0, 0] = np.nan
        mujoco.mjr_readPixels(colour, depth, self._rect, self._open_context)
        if error := mujoco.mjr_getError():
            raise RuntimeError(f"OpenGL error 0x{error:04x} while rendering")
        if depth is not None and np.isnan(depth[0, 0]):
            raise RuntimeError("OpenGL renders nothing: its context was lost")

    @property
    def _open_context(self) -> mujoco.MjrContext:
        if self._context is None:
            raise RuntimeError("the renderer is closed")
        return self._context


def _max_geoms(model: mujoco.MjModel) -> int:
    """Returns the largest number of objects in a scene: tendons and flexes are drawn in several pieces."""
    pieces = 2 * (model.nwrap + model.ntendon) + model.nflexvert + model.nflexedge + model.nflex + model.nskin
    return int(model.ngeom + model.nsite + pieces + _SPARE_GEOMS)
