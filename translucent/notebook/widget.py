"""Notebook widget of a scene: its state in the browser, and the traits of its material and camera.

Two traits go to the browser and come back: ``_media``, a dict of extinction, ior, roughness and distance for each
medium, and ``_camera``. All others are views of these, so that a change means the same whichever side it comes from;
those of the material go to the browser, too, since a `value` in marimo holds what does.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from translucent.errors import InputError
from translucent.extras import require_package
from translucent.formulas.color import to_hex
from translucent.media.colors import parse_color
from translucent.media.medium import BLACKEST, Medium, extinction_at
from translucent.media.presets import preset as named_preset
from translucent.page.plans import PagePlan, editable
from translucent.scene.camera import Camera
from translucent.scene.scene import Object, Scene
from translucent.scene.surface import Surface

Widget: Any = require_package("anywidget", "tl.view").AnyWidget
traitlets: Any = require_package("traitlets", "tl.view")

Json = dict[str, Any]

#: Largest index of refraction of the viewer.
MAX_IOR = 3.0

_FLAT = ("color", "distance", "ior", "roughness")


class SceneView(Widget):  # type: ignore[misc]
    """Viewer of a scene in a notebook, from `translucent.view`.

    Attributes
    ----------
    medium : int
        Which of the media of the scene the material traits are of.
    color : str
        Of white light after `distance`, as ``"#rrggbb"``; set it to any color that media take, a linear triple as well.
    distance : float
        In metres. Setting it keeps the color, and so changes the medium.
    ior : float
        1 to 3.
    roughness : float
        Of the interface, 0 to 1.
    preset : str or None
        Name of a preset that only absorbs; None once something else has changed.
    camera : Camera
    problem : str
        Why the browser cannot show the scene, if so.
    """

    _esm = traitlets.Unicode().tag(sync=True)
    _payload = traitlets.Bytes().tag(sync=True)
    _height = traitlets.Int(480).tag(sync=True)
    _label = traitlets.Unicode().tag(sync=True)
    _media = traitlets.List().tag(sync=True)
    _camera = traitlets.Dict().tag(sync=True)
    _moved = traitlets.Bool(False).tag(sync=True)
    problem = traitlets.Unicode("").tag(sync=True)

    medium = traitlets.Int(0).tag(sync=True)
    color = traitlets.Any().tag(sync=True)
    distance = traitlets.Float().tag(sync=True)
    ior = traitlets.Float().tag(sync=True)
    roughness = traitlets.Float().tag(sync=True)
    preset = traitlets.Unicode(None, allow_none=True).tag(sync=True)
    camera = traitlets.Instance(Camera)

    def __init__(self, planned: PagePlan, payload: bytes, script: str, media: list[Json], height: int) -> None:
        scene = planned.scene
        self._planned, self._scene, self._quiet = planned, scene, True
        self._bodies = _users(scene)
        self._exact = np.ones(3)  # the color, which hexadecimal digits round
        super().__init__(_esm=script, _payload=payload, _height=height, camera=scene.camera)
        self._label = f"Interactive view of a {repr(scene)[:1].lower()}{repr(scene)[1:]}"
        self._camera = _camera_values(scene, scene.camera)
        self._media = [{key: values[key] for key in ("extinction", "ior", "roughness", "distance")} for values in media]
        self.preset = media[0]["preset"] or None
        self._show()

    # What Python sees

    @property
    def media(self) -> tuple[str, ...]:
        """Names of the bodies of each medium."""
        return tuple(", ".join(dict.fromkeys(body.mesh.name for body in bodies)) for bodies in self._bodies)

    @property
    def scene(self) -> Scene:
        """The scene with the media and the camera that are shown."""
        objects = [self._planned.given_body(body) for body in self._scene.objects]
        for bodies, values in zip(self._bodies, self._media, strict=True):
            for body in bodies:
                if (changed := _changed(body, values)) is not body:
                    objects[self._scene.objects.index(body)] = changed
        return dataclasses.replace(self._scene, objects=objects, camera=self.camera)

    def set_material(self, **values: Any) -> None:
        """Change several of color, distance, ior, roughness and preset at once."""
        if unknown := sorted(set(values) - {*_FLAT, "preset"}):
            raise InputError(
                f"material {unknown[0]!r}",
                "the view has no trait of this name",
                f"use one of {', '.join(_FLAT)}, or preset",
            )
        if "preset" in values:
            self.preset = values["preset"]
        with self.hold_trait_notifications():
            for name in _FLAT:
                if name in values:
                    setattr(self, name, values[name])

    # Both directions

    def _show(self) -> None:
        """Show what `_media` and `_camera` hold in the traits that Python sees."""
        self._quiet = True
        try:
            values = self._media[self.medium]
            self.distance, self.ior, self.roughness = values["distance"], values["ior"], values["roughness"]
            self._exact = Medium(absorption=values["extinction"]).transmittance(values["distance"])
            self.color = to_hex(self._exact)
            if self.preset is not None and not _is_preset(values, self.preset):
                self.preset = None
        finally:
            self._quiet = False

    @traitlets.observe("_media", "medium")  # type: ignore[untyped-decorator]
    def _media_changed(self, _: Any) -> None:
        if not self._quiet:
            self._show()

    @traitlets.observe(*_FLAT)  # type: ignore[untyped-decorator]
    def _material_changed(self, change: Any) -> None:
        if self._quiet:
            return
        values = dict(self._media[self.medium])
        values |= {"ior": self.ior, "roughness": self.roughness, "distance": self.distance}
        if change["name"] in ("color", "distance"):
            values["extinction"] = extinction_at(np.maximum(self._exact, BLACKEST), self.distance).tolist()
        self._set_medium(values)

    @traitlets.observe("preset")  # type: ignore[untyped-decorator]
    def _preset_changed(self, change: Any) -> None:
        if self._quiet or change["new"] is None:
            return
        found = named_preset(change["new"])
        known = {"extinction": found.medium.extinction.tolist(), "ior": found.medium.ior, "roughness": found.roughness}
        self._set_medium({**self._media[self.medium], **known})

    @traitlets.observe("camera")  # type: ignore[untyped-decorator]
    def _camera_set(self, change: Any) -> None:
        if not self._quiet:
            self._moved = True
            self._camera = _camera_values(self._scene, change["new"])

    @traitlets.observe("_camera")  # type: ignore[untyped-decorator]
    def _camera_received(self, change: Any) -> None:
        values = change["new"]
        if self._quiet or values == _camera_values(self._scene, self.camera):
            return
        self._quiet = True
        try:
            self._moved = True
            self.camera = _camera_of(self._scene.camera, values)
        finally:
            self._quiet = False

    def _set_medium(self, values: Json) -> None:
        """Give the shown medium these values, in the browser and here."""
        media = list(self._media)
        media[self.medium] = values
        self._media = media

    # What may be set

    @traitlets.validate("medium")  # type: ignore[untyped-decorator]
    def _check_medium(self, proposal: Any) -> int:
        number = int(proposal["value"])
        if not 0 <= number < len(self._bodies):
            raise InputError(f"medium {number}", f"the scene has {len(self._bodies)} media", "count media from 0")
        return number

    @traitlets.validate("color")  # type: ignore[untyped-decorator]
    def _check_color(self, proposal: Any) -> str:
        exact = parse_color(proposal["value"])
        if not ((exact >= 0) & (exact <= 1)).all():
            raise InputError(
                f"color {proposal['value']!r}",
                "a channel of the color is outside 0..1",
                "use a color such as '#7b1e3a'",
            )
        self._check_editable()
        if not self._quiet:
            self._exact = exact
        return to_hex(exact)

    @traitlets.validate("distance", "ior", "roughness")  # type: ignore[untyped-decorator]
    def _check_number(self, proposal: Any) -> float:
        name, value = proposal["trait"].name, float(proposal["value"])
        low, high = {"distance": (0.0, np.inf), "ior": (1.0, MAX_IOR), "roughness": (0.0, 1.0)}[name]
        if not low <= value <= high or (name == "distance" and not 0 < value < np.inf):
            allowed = "above 0 and finite" if name == "distance" else f"in {low:g} to {high:g}"
            raise InputError(f"{name} {value:g}", f"the value must be {allowed}", "choose another value")
        self._check_editable()
        return value

    @traitlets.validate("preset")  # type: ignore[untyped-decorator]
    def _check_preset(self, proposal: Any) -> str | None:
        name: str | None = proposal["value"]
        if name is None or self._quiet:
            return name
        found = named_preset(name)
        if found.medium.scatters or found.medium.emits:
            do = "show a new scene: tl.showcase(mesh, tl.preset(...).medium)"
            raise InputError(
                f"preset {name!r} in a view",
                "this preset scatters or emits light, but a view supports only media that absorb",
                do,
            )
        self._check_editable()
        return name

    def _check_editable(self) -> None:
        """Raise `InputError` if the viewer cannot change the shown medium."""
        why = "" if self._quiet else next(filter(None, map(editable, self._bodies[self.medium])), "")
        if why:
            raise InputError(f"medium {self.medium} of a view", why, "show a new scene with another medium")


def _users(scene: Scene) -> list[list[Object]]:
    """Bodies of each medium, in the order of pages."""
    users: dict[int, list[Object]] = {}
    media: dict[Medium, int] = {}
    for body in scene.objects:
        if body.medium is not None and not body.covers:
            users.setdefault(media.setdefault(body.medium, len(media)), []).append(body)
    return list(users.values())


def _changed(body: Object, values: Json) -> Object:
    """Body with the medium and the roughness that are shown."""
    assert body.medium is not None
    if editable(body) or _same(body, values):
        return body
    medium = Medium(absorption=values["extinction"], ior=values["ior"])
    surface = body.surface or Surface()
    plain = body.surface is None and values["roughness"] == 0
    changed = None if plain else dataclasses.replace(surface, roughness=values["roughness"])
    return dataclasses.replace(body, medium=medium, surface=changed)


def _same(body: Object, values: Json) -> bool:
    """True if a body has the shown values, so that it need not be made anew."""
    assert body.medium is not None
    roughness = 0.0 if body.surface is None else body.surface.roughness
    alike = np.allclose(body.medium.extinction, values["extinction"], rtol=1e-12, atol=0)
    return bool(alike) and (body.medium.ior, roughness) == (values["ior"], values["roughness"])


def _is_preset(values: Json, name: str) -> bool:
    """True if a medium is that of a preset."""
    found = named_preset(name)
    alike = np.allclose(values["extinction"], found.medium.extinction, rtol=1e-9, atol=0)
    return bool(alike) and (values["ior"], values["roughness"]) == (found.medium.ior, found.roughness)


def _camera_values(scene: Scene, camera: Camera) -> Json:
    """Eye, target and up of a camera, whose target is beside the middle of the scene."""
    ahead = float((scene.bounds.mean(axis=0) - camera.eye) @ camera.forward)
    target = camera.eye + (ahead if ahead > 0 else scene.diagonal) * camera.forward
    return {"eye": camera.eye.tolist(), "target": target.tolist(), "up": camera.up.tolist()}


def _camera_of(old: Camera, values: Json) -> Camera:
    """Camera of the browser, with the angle or height of view of an old one."""
    eye, target, up = values["eye"], values["target"], values["up"]
    if old.fov_y is None:
        return Camera.orthographic(eye, target, up, height=old.height or 1.0)
    return Camera.look_at(eye, target, up, fov_y=old.fov_y)
