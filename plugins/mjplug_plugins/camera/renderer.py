"""Draws the model with one OpenGL context, however many cameras there are."""

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
_PACKED = np.array([1, 1 << 8, 1 << 16], np.int32)


class Renderer:
    """Draws one camera at a time. Bound to the thread that made it.

    Attributes:
        gl: The context.

    Args:
        model: The renderer's own copy: its visual settings are changed.
        width: Of the largest image [pixels].
        height: Likewise.
        quality: `fast` leaves out shadows, reflections, haze and multisampling.
        geom_groups: Groups of geoms that are drawn.
        site_groups: Groups of sites that are drawn.

    Raises:
        UnavailableError: There is no OpenGL, or it cannot draw images of this size.
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
        # All four are read when the context is made.
        model.vis.global_.offwidth, model.vis.global_.offheight = width, height
        if quality == "fast":
            model.vis.quality.offsamples = model.vis.quality.shadowsize = 0
        self.gl = GlContext(width, height)
        self._context: mujoco.MjrContext | None = None
        try:
            self._context = mujoco.MjrContext(model, _FONT)
            mujoco.mjr_setBuffer(_OFFSCREEN, self._context)
            if (self._context.offWidth, self._context.offHeight) != (width, height):
                raise UnavailableError(f"this OpenGL cannot draw {width}x{height} pixels")
        except mujoco.FatalError as error:
            self.close()
            raise unavailable(error) from error
        except UnavailableError:
            self.close()
            raise
        # Reversed depth is the precise one: floats are fine near zero, and zero is far.
        self._context.readDepthMap = int(mujoco.mjtDepthMap.mjDEPTH_ZEROFAR)
        self._smooth = self._context.offSamples > 0
        has_sky = bool(np.any(model.tex_type == _SKY_TEXTURE))
        self._sky = Sky(int(model.vis.quality.numslices)) if has_sky else None
        self._sky_verified: bool | None = None
        self._translucent = has_translucent(model)
        self._scene = mujoco.MjvScene(model, _most_geoms(model))
        if quality == "fast":
            # The haze is drawn with the sky, over what is in front of it.
            self._scene.flags[[_SHADOW, _REFLECTION, _HAZE]] = 0
        self._options = mujoco.MjvOption()
        self._options.flags[_RANGEFINDER] = 0
        self._options.geomgroup[:] = np.isin(range(len(self._options.geomgroup)), list(geom_groups))
        self._options.sitegroup[:] = np.isin(range(len(self._options.sitegroup)), list(site_groups))
        self._camera = mujoco.MjvCamera()
        self._camera.type = int(mujoco.mjtCamera.mjCAMERA_FIXED)
        self._rect = mujoco.MjrRect(0, 0, width, height)

    def look(self, data: mujoco.MjData, camera: int, width: int, height: int) -> None:
        """Sets up the scene as a camera sees it, for images of this size [pixels]."""
        self._camera.fixedcamid = camera
        self._rect = mujoco.MjrRect(0, 0, width, height)
        mujoco.mjv_updateScene(self._model, data, self._options, None, self._camera, _EVERYTHING, self._scene)

    def draw(self, colour: NDArray[np.uint8] | None, depth: NDArray[np.float32] | None) -> None:
        """Draws and reads the pixels, bottom row first.

        The depth is that of opaque things: one sees through what is translucent, and the sky is background.

        Args:
            colour: Shape (rows, columns, 3); None leaves it out.
            depth: Shape (rows, columns): the raw depth buffer, 1 at the near plane and 0 at the far one and for the
                background; None leaves it out.

        Raises:
            RuntimeError: OpenGL reports an error, or does not answer any more.
        """
        # A pixel of a multisampled depth buffer is not the depth at the pixel's centre: that needs a drawing by id.
        if colour is None or depth is None or self._smooth or not self._sky_is_known():
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
            # To OpenGL the sky is a body like others.
            self._sky.erase(self._scene.camera[0], depth)

    def draw_geoms(self, out: NDArray[np.int32]) -> None:
        """Draws and reads which geom is seen in each pixel, bottom row first; -1 is none.

        Args:
            out: Shape (rows, columns).

        Raises:
            RuntimeError: OpenGL reports an error.
        """
        colour = np.empty((*out.shape, 3), np.uint8)
        self._render(by_id=True)
        self._read(colour, None)
        drawn = self._scene.ngeom
        geoms = np.full(drawn + 1, -1, np.int32)
        for thing in self._scene.geoms[:drawn]:
            if thing.objtype == _GEOM and thing.segid >= 0:
                geoms[thing.segid + 1] = thing.objid
        np.take(geoms, colour @ _PACKED, out=out, mode="clip")

    def metres(self, depth: NDArray[np.float32]) -> None:
        """Turns raw depths of the last drawing into distances along the optical axis, in place [m]."""
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
        """Whether the last scene had more objects than there was room for."""
        return bool(self._scene.status)

    def close(self) -> None:
        """Frees everything; a second call does nothing."""
        if self._context is not None:
            self._context.free()
            self._context = None
        self.gl.close()

    def _sky_is_known(self) -> bool:
        """Whether the sky, if there is one, can be told from what stands before it by its depth."""
        camera = self._scene.camera[0]
        if self._sky is None:
            return True
        if camera.orthographic:
            return False
        if self._sky_verified is None:
            # Another MuJoCo may have another sky.
            depth = np.empty((self._rect.height, self._rect.width), np.float32)
            self._scene.ngeom, drawn = 0, self._scene.ngeom
            self._render(sky=True)
            self._scene.ngeom = drawn
            self._read(None, depth)
            self._sky_verified = bool(self._sky.seen(camera, depth).all())
        return self._sky_verified

    def _render_opaque_by_id(self) -> None:
        """Draws opaque things without multisampling, which MuJoCo switches off for drawings by id."""
        if not self._translucent:
            self._render(by_id=True)
            return
        with translucent_hidden(self._scene):
            self._render(by_id=True)

    def _render(self, sky: bool = False, by_id: bool = False) -> None:
        self._scene.flags[_SKYBOX] = sky
        self._scene.flags[_BY_ID] = by_id
        mujoco.mjr_render(self._rect, self._scene, self._drawing)

    def _read(self, colour: NDArray[np.uint8] | None, depth: NDArray[np.float32] | None) -> None:
        if depth is not None:
            depth[0, 0] = np.nan
        mujoco.mjr_readPixels(colour, depth, self._rect, self._drawing)
        if error := mujoco.mjr_getError():
            raise RuntimeError(f"OpenGL error 0x{error:04x} while drawing")
        if depth is not None and np.isnan(depth[0, 0]):
            raise RuntimeError("OpenGL draws nothing any more: its context was lost")

    @property
    def _drawing(self) -> mujoco.MjrContext:
        if self._context is None:
            raise RuntimeError("the renderer is closed")
        return self._context


def _most_geoms(model: mujoco.MjModel) -> int:
    """Returns how many objects a scene may need: tendons and flexes are drawn in pieces."""
    pieces = 2 * (model.nwrap + model.ntendon) + model.nflexvert + model.nflexedge + model.nflex + model.nskin
    return int(model.ngeom + model.nsite + pieces + _SPARE_GEOMS)
