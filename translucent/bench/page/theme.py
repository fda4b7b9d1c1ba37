"""Colors and symbols of the page: one pair for each family of methods, apart for color-blind readers in both themes."""

from __future__ import annotations

from dataclasses import dataclass

#: CSS variables by name: the color on a light page, and on a dark one. The families' are those of Okabe & Ito 2008,
#: darkened or lightened until their contrast with the page is 3 : 1 or more.
COLORS = {
    "paper": ("#ffffff", "#14171a"),
    "panel": ("#f4f5f6", "#1e2226"),
    "ink": ("#1a1d20", "#e8eaec"),
    "muted": ("#596067", "#a3abb3"),
    "line": ("#d3d7db", "#3a4148"),
    "good": ("#006e50", "#45d3a8"),
    "bad": ("#b34700", "#ff9352"),
    "green": ("#009e73", "#2fc79b"),
    "vermilion": ("#d55e00", "#ff8a3d"),
    "pink": ("#c0679a", "#e79bc6"),
    "orange": ("#b87e00", "#f2b632"),
    "blue": ("#0072b2", "#5db2ec"),
    "sky": ("#2b93cf", "#a5dcff"),
    "olive": ("#857a00", "#efe342"),
}


@dataclass(frozen=True)
class Style:
    """Style of a family: the name of its color, and a symbol of matplotlib, as (points, 1, turn) a star."""

    color: str
    marker: str | tuple[int, int, int]


FAMILIES = {
    "depth only": Style("muted", "|"),
    "SignedDepth": Style("green", "o"),
    "BackFaceDepth": Style("orange", "s"),
    "ThinLayer": Style("pink", "D"),
    "FragmentLists": Style("ink", "P"),
    "DepthPeeling": Style("blue", "^"),
    "KBuffer": Style("sky", "v"),
    "RayMarched": Style("olive", "*"),
    "TracedInterfaces": Style("green", "d"),
    "ScreenInterfaces": Style("sky", "<"),
    "FrontInterface": Style("orange", ">"),
    "Diffusion": Style("green", "8"),
    "ScatteringLayer": Style("blue", (4, 1, 0)),
    "SingleScattering": Style("pink", (6, 1, 0)),
    "layer without inner mirrors": Style("vermilion", "1"),
    "Burley's normalized diffusion": Style("orange", "x"),
    "Frostbite's translucency": Style("olive", "+"),
    "constant thickness": Style("vermilion", "X"),
    "sphere assumption": Style("vermilion", "p"),
    "cpu backend": Style("muted", "h"),
    "RayMarched on the CPU": Style("muted", "H"),
}

_OTHERS = (Style("ink", "<"), Style("vermilion", ">"), Style("blue", "d"), Style("olive", "8"))


def style_of(family: str) -> Style:
    """The style of a family; families that this page does not know share the remaining ones by their names."""
    return FAMILIES.get(family) or _OTHERS[sum(family.encode()) % len(_OTHERS)]


def css_variables() -> str:
    """The rules that give the page, and a figure of its own, their colors in both themes."""
    light, dark = (" ".join(f"--{name}: {pair[theme]};" for name, pair in COLORS.items()) for theme in (0, 1))
    return (
        f":root {{ color-scheme: light dark; {light} }}\n@media (prefers-color-scheme: dark) {{ :root {{ {dark} }} }}"
    )


def placeholder(name: str) -> str:
    """A color that stands for a CSS variable while matplotlib draws; `figure.to_svg` puts the variable there."""
    return f"#0102{list(COLORS).index(name) + 16:02x}"
