"""The layout of the page in the browser: the view, what it shows, the history, and the time below."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cfddem.plotting.browser import Viewer

_SIDE = "width: 430px; min-width: 430px; overflow-y: auto; border-left: 1px solid #ddd; padding: 12px"
_MARK = (
    "`position: absolute; width: 2px; background: #e08a00; left: ${100 * mark}%; top: ${100 * strip_top}%; "
    "height: ${100 * (strip_bottom - strip_top)}%`"
)


def layout(viewer: Viewer) -> tuple[Any, Any]:
    """Build the page; returns it, and the view in it, whose `update()` sends a new image."""
    from trame.ui.vuetify3 import VAppLayout
    from trame.widgets import html
    from trame.widgets import vtk as vtk_widgets
    from trame.widgets import vuetify3 as v3

    server = viewer.server
    server.state.trame__title = f"cfddem: {server.state.title}"
    with VAppLayout(server) as page:
        with v3.VAppBar(density="compact", flat=True, border=True):
            v3.VAppBarTitle("{{ title }}")
            html.Span("{{ status }}", classes="text-medium-emphasis mr-4", id="status")
            v3.VBtn("front", click=viewer.turn_to_front, variant="text", id="front")
        with v3.VMain(style="height: 100vh"), html.Div(style="display: flex; height: 100%"):
            with html.Div(style="flex: 1; min-width: 0; position: relative"):
                view = vtk_widgets.VtkRemoteView(
                    viewer.scene.plotter.render_window,  # type: ignore[union-attr]
                    interactive_ratio=1, still_quality=95,
                )  # fmt: skip
                v3.VAlert(
                    "{{ problem }}", v_if="problem", type="warning", density="compact",
                    style="position: absolute; top: 8px; left: 8px; right: 8px",
                )  # fmt: skip
            with html.Div(style=_SIDE):
                _choices(v3)
                _curves(html, v3)
        with v3.VFooter(app=True, border=True, classes="py-1", style="gap: 12px"):
            _time(html, v3)
    return page, view


def _choices(v3: Any) -> None:
    """What the view shows."""
    options = {"density": "compact", "hide_details": True, "variant": "outlined", "classes": "mb-3"}
    v3.VSelect(v_model=("colour",), items=("colours",), label="colour of the spheres", id="colour", **options)
    v3.VSelect(v_model=("layer",), items=("layers",), label="layer of the fluid", id="layer", **options)
    v3.VSlider(
        v_model=("place",), min=0, max=1, step=0.02, label="position of the layer", density="compact",
        hide_details=True, id="place",
    )  # fmt: skip
    v3.VCheckbox(
        v_model=("cut",), label="spheres behind the layer only", density="compact", hide_details=True, id="cut"
    )


def _curves(html: Any, v3: Any) -> None:
    """The history, with a line at the time of the view."""
    v3.VSelect(
        v_model=("columns",), items=("known_columns",), label="history", multiple=True, chips=True, density="compact",
        hide_details=True, variant="outlined", classes="mb-2 mt-2", id="columns",
    )  # fmt: skip
    with html.Div(style="position: relative", v_if="strip", id="strip"):
        html.Img(src=("strip",), style="width: 100%; display: block")
        html.Div(style=(_MARK,), id="mark")


def _time(html: Any, v3: Any) -> None:
    """Time: play, slider, clock, follow."""
    v3.VBtn(
        icon=("playing ? 'mdi-pause' : 'mdi-play'",), click="playing = !playing", variant="text", density="compact",
        id="play",
    )  # fmt: skip
    v3.VSlider(v_model=("snapshot",), min=0, max=("last",), step=1, hide_details=True, density="compact", id="time")
    html.Span(
        "snapshot {{ snapshot }} of {{ last }},  t = {{ clock }}",
        style="min-width: 230px; white-space: nowrap",
        id="clock",
    )
    v3.VSwitch(v_model=("follow",), label="follow", hide_details=True, density="compact", color="primary", id="follow")
