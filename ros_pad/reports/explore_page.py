# SPDX-License-Identifier: Apache-2.0
"""The page of ``pad explore``, served to this machine alone; nothing is loaded from elsewhere."""

from __future__ import annotations

import asyncio
import html
import math
from typing import Any

from ros_pad import configuration
from ros_pad.contact import Foot
from ros_pad.contact.foot_file import foot_text
from ros_pad.contact.limits import CRITERIA
from ros_pad.errors import PadError
from ros_pad.making.files import zipped
from ros_pad.making.plan import plan
from ros_pad.reports import explore, explore_drawings, moulds
from ros_pad.reports.explore import FIELDS, LIQUIDS, MEASURED, Explored, Field, Inputs
from ros_pad.reports.style import BLUE, VERMILION

HOST = '127.0.0.1'
_NOTE = 'Friction rests on assumed constants, which may be wrong by a factor of two:'
_NOTE += ' docs/assumptions.md.'
_GROUPS = {
    'Pads': ('material', 'pads', 'radius', 'stiffness', 'thickness', 'sole_radius', 'criterion'),
    'Air': ('supply', 'pressure', 'bore', 'hose'),
    'Ground': ('load', 'liquid', 'film', 'stand', 'roughness'),
}
_CHOICES = {'material': 'Material', 'criterion': 'Criterion of the limit', 'liquid': 'Liquid'}
_CSS = f"""
body {{ font: 15px/1.45 system-ui, sans-serif; }}
.nicegui-content {{ padding: 0; display: block; }}
.explore {{ display: grid; grid-template-columns: 21rem minmax(0, 1fr); gap: 0 1.5rem;
  grid-template-rows: auto auto 1fr; max-width: 1500px; margin: 0 auto; padding: 1rem 1.25rem; }}
.top {{ grid-column: 1 / -1; display: flex; gap: 1rem; align-items: center; }}
.top > :first-child {{ margin-right: auto; }}
h1 {{ font-size: 1.35rem; font-weight: 650; line-height: 1.2; margin: 0; }}
h2 {{ font-size: 0.95rem; font-weight: 650; line-height: 1.4; margin: 0.9rem 0 0.35rem; }}
.inputs {{ grid-row: 2 / 4; }}
.control {{ margin-bottom: 0.4rem; }}
.control input[type=range] {{ width: 100%; margin: 0; }}
.remark {{ font-size: 0.82rem; line-height: 1.3; margin: 0.1rem 0 0.4rem;
  padding-left: 0.5rem; border-left: 3px solid {BLUE}; overflow-wrap: anywhere; }}
.remark.error {{ border-color: {VERMILION}; font-weight: 600; }}
.figures, .numbers {{ display: grid; gap: 0.5rem 1.5rem; }}
.figures {{ grid-template-columns: repeat(auto-fit, minmax(25rem, 1fr)); }}
.numbers {{ grid-template-columns: repeat(auto-fit, minmax(15rem, 1fr)); }}
.numbers table {{ width: 100%; font-size: 0.86rem; border-collapse: collapse; }}
td {{ border-bottom: 1px solid #dcdfe4; }} td:last-child {{ text-align: right; }}
.note {{ font-size: 0.82rem; margin-top: 0.8rem; }}
.figures svg {{ width: 100%; height: auto; }}
.stale {{ opacity: 0.35; transition: opacity 0s 0.1s; }}
"""


def serve(foot: Foot, port: int, browser: bool) -> None:
    """Serve the page until a signal ends the process.

    Parameters
    ----------
    foot : Foot
        The foot to begin with.
    port : int
        TCP port on the loopback interface.
    browser : bool
        Open a browser.

    Raises
    ------
    PadError
        When NiceGUI is not installed.
    """
    try:
        from nicegui import app, core, ui
        from starlette.middleware.trustedhost import TrustedHostMiddleware
    except ImportError as error:
        raise PadError(f"NiceGUI is missing ({error}): pip install 'ros_pad[explore]'") from error
    print(f'http://{HOST}:{port}/ shows {foot.source}; Ctrl-C ends it', flush=True)
    # A page elsewhere whose name leads to this machine must not read this one, nor any other page
    # open its socket: NiceGUI lets all of them.
    app.add_middleware(TrustedHostMiddleware, allowed_hosts=[HOST, 'localhost'])
    core.sio.eio.cors_allowed_origins = None
    ui.run(
        lambda: Page(explore.inputs_of(foot)).build(),
        host=HOST,
        port=port,
        title=f'{foot.source} · pad explore',
        language='en-US',
        show=browser,
        reload=False,
        tailwind=False,
        show_welcome_message=False,
        timeout_graceful_shutdown=1,
    )


class Page:
    """One opened page: its inputs, and the answer that it shows.

    Parameters
    ----------
    inputs : Inputs
        What it begins with.
    """

    def __init__(self, inputs: Inputs) -> None:
        from nicegui import ui

        self._ui: Any = ui
        self._inputs = inputs
        self._answered: Inputs | None = None
        self._one = asyncio.Lock()
        self._count = 0
        self._controls: dict[str, Any] = {}
        self._remarks: dict[str, Any] = {}

    def build(self) -> None:
        """Make the elements of the page, and ask for the first answer."""
        ui = self._ui
        ui.add_css(_CSS)
        fields = {field.name: field for field in FIELDS}
        with ui.element('div').classes('explore'):
            with ui.element('div').classes('top'):
                ui.html(
                    f'<h1>Foot {html.escape(self._inputs["foot"].source)}</h1>', sanitize=False
                )
                self._status = ui.label().props('role=status')
                for words, action in (('Foot file', self._export), ('Moulds', self._moulds)):
                    ui.button(words, on_click=action).props('outline no-caps dense')
            with ui.element('section').classes('inputs').props('aria-label="Inputs"'):
                for title, names in _GROUPS.items():
                    ui.html(f'<h2>{title}</h2>', sanitize=False)
                    for name in names:
                        self._controls[name] = ui.element('div').classes('control')
                        with self._controls[name]:
                            if name in fields:
                                self._number(fields[name])
                            else:
                                self._choice(name)
                            self._remarks[name] = ui.html(sanitize=False)
            with ui.element('section').props('aria-label="Drawings"') as both:
                self._figures = ui.html(sanitize=False)
            with ui.element('section').classes('answer').props('aria-label="Numbers"') as numbers:
                self._numbers = ui.html(sanitize=False)
                ui.html(f'<p class="note">{_NOTE}</p>', sanitize=False)
        self._answers = both, numbers
        # The page waits for no answer: NiceGUI gives up on one that takes long.
        ui.timer(0.0, self.answer, once=True)

    def _number(self, field: Field) -> None:
        """Make a number and its slider, which move one another."""
        value = self._inputs[field.name]
        shown = None if value is None else field.read(value)
        sliding = False

        def slid(event: Any) -> None:
            nonlocal sliding
            sliding = True
            box.set_value(float(event.args))
            sliding = False

        async def changed(event: Any) -> None:
            number = event.value
            if not sliding:
                place(number)
            await self.change(field.name, _si(field, number))

        def place(number: float | None) -> None:
            # As a property of the element an old value would pull at a slider that moves.
            if number is not None:
                ui.run_javascript(f'getHtmlElement({slider.id}).value = {number}')

        ui = self._ui
        box = ui.number(field.label, value=shown, format='%.12g', on_change=changed)
        box.props(f'dense outlined suffix="{field.shown}" name={field.name} step=any')
        slider = ui.element('input').props(
            f'type=range min={field.low} max={field.high} step={field.step}'
            f' aria-label="{", ".join(filter(None, (field.label, field.shown)))}"'
        )
        slider.on('input', slid, js_handler='(event) => emit(event.target.value)')
        place(shown)

    def _choice(self, name: str) -> None:
        value = self._inputs[name]
        known = {
            'material': [MEASURED, *configuration.names('materials')],
            'criterion': list(CRITERIA),
            'liquid': list(LIQUIDS),
        }[name]
        self._ui.select(
            known if value in known else [*known, value],
            label=_CHOICES[name],
            value=value,
            on_change=lambda event: self.change(name, event.value),
        ).props(f'dense outlined options-dense aria-label="{_CHOICES[name]}" name={name}')

    async def change(self, name: str, value: Any) -> None:
        """Take a value of an input, and show the answer to it."""
        self._inputs = self._inputs | {name: value}
        await self.answer()

    async def answer(self) -> None:
        """Compute the answer to the present inputs beside the server, and show it.

        Changes that come meanwhile are answered together, by the last of them.
        """
        for each in self._answers:
            each.classes(add='stale')
        async with self._one:
            inputs = self._inputs
            if inputs is self._answered:
                return
            try:
                self._show(*await asyncio.to_thread(answer, inputs))
            except Exception as error:
                self._status.set_text(f'no answer: {error}')
                raise
            self._answered = inputs
            if inputs is self._inputs:
                for each in self._answers:
                    each.classes(remove='stale')

    def _show(self, found: Explored, figures: str, numbers: str) -> None:
        # A material has its stiffness from its law.
        self._controls['stiffness'].set_visibility(found.inputs['material'] == MEASURED)
        self._figures.set_content(f'<div class="figures">{figures}</div>')
        for name, element in self._remarks.items():
            element.set_content(
                ''.join(
                    f'<p class="remark{" error" if each.error else ""}" role="alert">'
                    f'{html.escape(each.text)}</p>'
                    for each in found.remarks
                    if each.name == name
                )
            )
        self._count += 1
        self._numbers.set_content(
            f'<div class="numbers" data-answer="{self._count}">{numbers}</div>'
        )
        self._status.set_text('')

    async def _foot(self) -> Foot | None:
        """Return the foot of the present inputs, or tell that there is none."""
        foot = (await asyncio.to_thread(explore.explore, self._inputs)).foot
        if foot is None:
            self._ui.notify('There is no foot: mend what is marked at the inputs', type='warning')
        return foot

    async def _export(self) -> None:
        """Download the foot of the present inputs."""
        if foot := await self._foot():
            self._ui.download.content(foot_file(foot), 'my_foot.yaml')

    async def _moulds(self) -> None:
        """Download the files that make the foot of the present inputs."""
        if not (foot := await self._foot()):
            return
        self._status.set_text('making moulds …')
        try:
            data = await asyncio.to_thread(moulds_of, foot)
        except PadError as error:
            self._ui.notify(
                str(error), type='warning', multi_line=True, timeout=0, close_button='OK'
            )
        else:
            self._ui.download.content(data, 'my_foot_moulds.zip')
        finally:
            self._status.set_text('')


def _si(field: Field, number: float | None) -> float | None:
    """Return what was typed in SI units; a number that is missing is NaN, or no thickness."""
    if number is None:
        return None if field.name == 'thickness' else math.nan
    if field.setting.value_type is int and number == int(number):
        return int(number)
    # Without the rounding of the unit: 1.3 mm are 0.0013 m.
    return float(f'{number * field.unit:.12g}')


def foot_file(foot: Foot) -> str:
    """Return the YAML text of a foot that was chosen on the page."""
    head = (
        f'Made by pad explore from the foot {foot.source}.',
        'Nothing of it was measured anew; what cannot be chosen there is that of this foot.',
    )
    comments = {'stiffness': 'as chosen', 'thickness': 'as chosen'}
    return foot_text(foot, f'{foot.source}, explored', head, comments)


def moulds_of(foot: Foot) -> bytes:
    """Return what ``pad mould`` writes for a foot, and its foot file, as a ZIP."""
    made = moulds.files(plan(foot))
    return zipped(made | {'my_foot.yaml': foot_file(foot).encode()})


def answer(inputs: Inputs) -> tuple[Explored, str, str]:
    """Return the answer to the inputs, its drawings and its numbers, as HTML."""
    found = explore.explore(inputs)
    numbers = ''
    for title, group in explore.rows(found).items():
        lines = ''.join(
            f'<tr><td>{html.escape(label)}</td><td id="{key}">{html.escape(text)}</td></tr>'
            for key, (label, text) in group.items()
        )
        numbers += f'<div><h2>{title}</h2><table>{lines}</table></div>'
    return found, explore_drawings.drawings(found), numbers
