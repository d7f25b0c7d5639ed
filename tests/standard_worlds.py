"""A world with the standard services, for tests."""

from mjplug import __version__
from mjplug.config.standard_settings import StandardSettings
from mjplug.model.library import Library
from mjplug.model.recipe import Source
from mjplug.services import clock
from mjplug.services.standard import model_changed, model_values
from mjplug.services.standard import service as standard_service
from mjplug.services.standard.world_builder import WorldBuilder
from mjplug.services.states.keeper import Keeper
from mjplug.services.stepping.ownership import Ownership
from mjplug.testing import World
from mjplug_schemas import registry
from mjplug_schemas.simulation_interfaces import Resource, WorldResource

SCENE = """
<mujoco model="table">
  <option timestep="0.002"/>
  <worldbody>
    <geom name="floor" type="plane" size="2 3 .1"/>
    <body name="cup" pos=".5 0 1">
      <freejoint/>
      <geom type="box" size=".1 .2 .3" pos=".05 0 0" mass="1"/>
    </body>
    <body name="ball" pos="-1 0 1">
      <freejoint name="ball_joint"/>
      <geom type="sphere" size=".1" mass="2"/>
    </body>
    <body name="arm" pos="0 1 0">
      <joint name="shoulder" type="hinge" axis="0 0 1"/>
      <geom type="capsule" size=".05" fromto="0 0 0 1 0 0" mass="1"/>
      <body name="hand" pos="1 0 0"><geom type="sphere" size=".1" mass="1"/><site name="tip" pos="0 0 .1"/></body>
    </body>
    <body name="marker" mocap="true" pos="0 0 3"><geom type="box" size=".1 .1 .1" contype="0" conaffinity="0"/></body>
    <body name="wall" pos="0 -2 0"><geom type="box" size="1 .1 1"/></body>
    <body pos="3 3 0"><geom type="sphere" size=".2"/></body>
    <body name="sheet" pos="0 0 -1"><geom type="plane" size="0 0 1" contype="0" conaffinity="0"/></body>
  </worldbody>
  <actuator><velocity name="shoulder" joint="shoulder" kv="1"/></actuator>
</mujoco>
"""


CUP = """
<mujoco model="cup">
  <worldbody>
    <body name="body"><freejoint name="free"/><geom name="wall" type="cylinder" size=".04 .05" mass=".2"/></body>
  </worldbody>
</mujoco>
"""
"""A free body."""

DOOR = """
<mujoco model="door">
  <worldbody>
    <geom name="post" type="box" size=".05 .05 1"/>
    <body name="leaf"><joint name="hinge" axis="0 0 1"/><geom type="box" size=".4 .02 1" pos=".4 0 0" mass="3"/></body>
  </worldbody>
  <actuator><position name="opener" joint="hinge" kp="10"/></actuator>
  <sensor><jointpos name="angle" joint="hinge"/></sensor>
</mujoco>
"""
"""Something that is fixed, with a joint, an actuator and a sensor."""


class StandardWorld(World):
    """A world whose standard services a test calls by their types."""

    def __init__(self, model=SCENE, paused=True, folders=(), **settings):
        super().__init__(model, paused=paused)
        self.mjplug = self.host("mjplug")
        self.ownership = Ownership("mjplug/@step")
        keeper = Keeper(self.loop, 0, __version__)
        clock.offer(self.mjplug, self.loop, 100.0)
        world = WorldResource(name="table", world_resource=Resource(uri="file:///table.xml"))
        self.builder = None
        if isinstance(model, str) and model.lstrip().startswith("<"):
            source, digest = Source(None, model), keeper.model_digest
            self.builder = WorldBuilder(self.loop, self.workers, source, digest, settings.get("spawn_wait", False))
            model_changed.offer(self.mjplug, self.builder, digest)
            model_values.offer(self.mjplug, self.builder)
        library = Library(folders)
        self.standard = standard_service.offer(
            self.mjplug,
            self.loop,
            StandardSettings(**settings),
            self.ownership,
            keeper.restart_time,
            world,
            self.builder,
            library,
        )
        self.keeper = keeper

    def _keeper(self):
        return self.keeper

    def spawn(self, name, text=CUP, **fields):
        """Spawns a model of XML text; returns the result."""
        resource = {"resource_string": text} if text.lstrip().startswith("<") else {"uri": text}
        return self.ask("SpawnEntity", name=name, entity_resource=resource, **fields)

    def send(self, service, **fields):
        """Sends a request; returns the call."""
        kind = registry.find(f"simulation_interfaces/srv/{service}")
        return self.call(f"/{standard_service.service_name(kind)}", kind.Request.model_validate(fields))

    def ask(self, service, **fields):
        """Sends a request; returns the response."""
        call = self.send(service, **fields)
        while not call.answered:
            self.loop.turn()
        assert call.refusal is None, call.refusal
        return call.response

    def code(self, service, **fields):
        """Sends a request; returns the code and the text of the result."""
        result = self.ask(service, **fields).result
        return result.result, result.error_message

    @property
    def state(self):
        return self.ask("GetSimulationState").state.state
