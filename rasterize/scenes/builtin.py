"""A scene that comes with the library, with its lights and a view of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import Light
from ssgi_cl.core.scene import Scene

Vector = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class BuiltinScene:
    """A scene made by code.

    Attributes:
        name: key in `BUILTIN_SCENES`, or KIND-SEED of a generated scene.
        scene: triangles and materials, in metres, y up.
        eye, target, up: the view, world space, metres.
        yfov: vertical field of view in radians.
        lights: what lights it, in W and metres.
        ao_radius: a reach of ambient occlusion that suits the scene, metres.
        more_views: (eye, target) of auxiliary views, with the same `up` and `yfov`.
        lights_stand_in: whether `lights` stand in for what its surfaces emit, so that a picture has
            either.
        closed: whether every surface bounds a volume, so that each edge has a triangle on either
            side; False where that is not known.
    """

    name: str
    scene: Scene
    eye: Vector
    target: Vector
    up: Vector = (0.0, 1.0, 0.0)
    yfov: float
    lights: tuple[Light, ...]
    ao_radius: float
    more_views: tuple[tuple[Vector, Vector], ...] = ()
    lights_stand_in: bool = False
    closed: bool = False

    @property
    def own_lights(self) -> tuple[Light, ...]:
        """The lights beside what surfaces emit: for pictures that emission lights."""
        return () if self.lights_stand_in else self.lights

    def views(self) -> tuple[BuiltinScene, ...]:
        """Return the scene as seen from each of its views, its own first."""
        every = ((self.eye, self.target), *self.more_views)
        return tuple(replace(self, eye=eye, target=at, more_views=()) for eye, at in every)

    def camera(self, width: int, height: int) -> Camera:
        """Return the view as a camera of `width` x `height` pixels."""
        return Camera.look_at(self.eye, self.target, self.up, yfov=self.yfov, width=width, height=height)
