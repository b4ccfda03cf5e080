# SPDX-License-Identifier: Apache-2.0
"""Measure how long the page of `pad explore` takes to answer a slider, in headless Chromium.

Writes explore.png, a picture of the page, and explore.json. Times, ms, are from the event of a
slider to the new numbers in the document; beside them is the processor time of the computation
alone, which other work on the machine changes less. It needs Chromium and playwright.
"""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import sys
import time
import urllib.parse
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from ros_pad.contact import Foot
from ros_pad.errors import PadError
from ros_pad.reports.explore import FIELDS, inputs_of
from ros_pad.reports.explore_page import answer
from ros_pad.reports.files import save
from studies import command

CHROMIUM = next(filter(None, map(shutil.which, ('chromium', 'chromium-browser', 'chrome'))), None)
OPTIONS = (
    *('--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run', '--disable-sync'),
    *('--disable-background-networking', '--disable-component-update'),
    '--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1',
)
FEET = ('large37', 'small217')
LONGEST = 60e3  # ms, until an answer comes, however slow the machine
# Always to values that were not there before: what was computed once is partly kept.
_MOVE = """async (slider, to) => {
  const [low, high, now, step] = ['min', 'max', 'value', 'step'].map(key => Number(slider[key]));
  const answer = () => document.querySelector('[data-answer]').dataset.answer;
  const before = answer(), start = performance.now();
  slider.dataset.way ??= now > 0.5 * (low + high) ? -1 : 1;
  slider.value = to ?? now + slider.dataset.way * step;
  slider.dispatchEvent(new Event('input', {bubbles: true}));
  const tick = () => new Promise(done => setTimeout(done, 1));
  while (answer() === before && Number(slider.value) !== now) await tick();
  return performance.now() - start;
}"""


@contextmanager
def served(*words: str) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """Run ``pad explore`` with arguments; yield the address of its page, and the process."""
    environment = {name: value for name, value in os.environ.items() if 'PYTEST' not in name}
    child = subprocess.Popen(
        [sys.executable, '-m', 'ros_pad', 'explore', '--no-browser', *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
    )
    assert child.stdout is not None
    try:
        address = child.stdout.readline().partition(' ')[0]
        while not _listens(address):
            if child.poll() is not None:
                raise PadError(f'pad explore ended: {child.communicate()[1]}')
            time.sleep(0.05)
        yield address, child
    finally:
        child.send_signal(signal.SIGTERM)
        child.communicate(timeout=60)


def _listens(address: str) -> bool:
    parts = urllib.parse.urlsplit(address)
    try:
        socket.create_connection((parts.hostname, parts.port)).close()
    except OSError:
        return False
    return True


@contextmanager
def browser() -> Iterator[Any]:
    """Yield a headless Chromium that finds no host but this one."""
    from playwright.sync_api import sync_playwright

    if CHROMIUM is None:
        raise PadError('no Chromium is installed: the page cannot be opened')
    with sync_playwright() as play:
        found = play.chromium.launch(executable_path=CHROMIUM, args=[*OPTIONS])
        try:
            yield found
        finally:
            found.close()


def opened(chromium: Any, address: str, **options: Any) -> Any:
    """Return a page with its first answer."""
    page = chromium.new_page(**options)
    page.set_default_timeout(LONGEST)
    page.goto(address)
    page.wait_for_selector('[data-answer]')
    return page


def measure(page: Any, moves: int) -> dict[str, list[float]]:
    """Return the times of answers, ms, by the slider that is moved, and put back after that."""
    found = {}
    for field in FIELDS:
        moved = slider(page, field.label)
        before = moved.input_value()
        found[field.name] = [moved.evaluate(_MOVE) for _ in range(moves)]
        moved.evaluate(_MOVE, before)
    return found


def computed(foot: str, moves: int) -> dict[str, list[float]]:
    """Return the processor times of the same answers without a page, ms, by slider."""
    shipped = inputs_of(Foot.load(foot))
    answer(shipped)
    found: dict[str, list[float]] = {}
    for field in FIELDS:
        inputs = shipped
        for _ in range(moves):
            down = shipped[field.name] > 0.5 * (field.low + field.high) * field.unit
            step = -field.step if down else field.step
            moved = inputs[field.name] + step * field.unit
            inputs = inputs | {field.name: moved}
            start = time.process_time()
            answer(inputs)
            found.setdefault(field.name, []).append(1e3 * (time.process_time() - start))
    return found


def slider(page: Any, label: str) -> Any:
    """Return a slider by the label of its field."""
    names = f'[aria-label="{label}"], [aria-label^="{label},"]'  # the second has a unit
    return page.locator(f'input[type=range]:is({names})')


def main(words: Sequence[str]) -> int:
    """Measure, print and draw."""
    parser = command.parser('explore', __doc__)
    command.add_count(parser, '--moves', 10, 'moves of each slider')
    command.add_out(parser)
    options = parser.parse_args(words)
    times, alone = {}, {}
    with browser() as chromium:
        for foot in command.each(FEET, 'explore', 'foot'):
            alone[foot] = computed(foot, options.moves)
            with served(foot) as (address, _):
                page = opened(chromium, address, viewport={'width': 1440, 'height': 900})
                if foot == FEET[0]:
                    options.out.mkdir(parents=True, exist_ok=True)
                    save(options.out / 'explore.png', page.screenshot(full_page=True))
                times[foot] = measure(page, options.moves)
                page.close()
    rows = []
    for foot, found in times.items():
        for name in (*found, 'all'):
            row: dict[str, Any] = {'foot': foot, 'slider': name}
            for word, each in (('page, ms', found), ('processor, ms', alone[foot])):
                own = each.get(name) or [time for some in each.values() for time in some]
                row[f'{word}: median, 95 %'] = np.quantile(own, (0.5, 0.95)).tolist()
            rows.append(row)
    load = os.getloadavg()[0]
    title = f'{load:.1f} processes on {os.cpu_count()} cores in the last minute'
    kept = command.write(
        options.out, 'explore', {'load': load, 'times_ms': times, 'processor_ms': alone}
    )
    command.show(options, kept, command.listed(rows, title))
    return 0
