# SPDX-License-Identifier: Apache-2.0
"""All files that make a foot: meshes, drawing, parts list, steps, and the foot as it is made."""

from __future__ import annotations

import csv
import html
import io
import math
from collections.abc import Iterator, Mapping
from dataclasses import replace

import matplotlib

from ros_pad.configuration import shared_folder
from ros_pad.making import Part, Plan, build, plan
from ros_pad.making.expect import DENSITY, as_made, batches, ceiling_of, expected
from ros_pad.making.files import dxf, stl, three_mf
from ros_pad.making.solids import as_printed
from ros_pad.pace import Progress
from ros_pad.reports.mould_drawings import drawing, exploded
from ros_pad.reports.page import heading, page, section, table, warning
from ros_pad.reports.style import STYLE, rendered

PRINTED = ('filament', 'resin')
HEADS = ('part', 'of', 'size, mm', 'volume, cm³', 'mass, g', 'triangles', 'on the bed')
_UNTRIED = (
    'No foot was made by these files yet: they were modelled, checked and sliced. Cast the test'
    ' piece first: test_piece/making.html.'
)
_SILICONE = (
    'silicone',
    'in the foot, g',
    'part A, g',
    'part B, g',
    'pot life, min',
    'cure, h',
    '',
)


def files(made: Plan, progress: Progress = lambda _: None) -> dict[str, bytes]:
    """Return all files of a foot by name.

    Parameters
    ----------
    made : Plan
        The foot.
    progress : callable
        Takes how many of three steps are done.

    Raises
    ------
    InvalidInput
        When its test piece cannot be made.
    PadError
        When manifold3d is not installed.
    """
    found: dict[str, bytes] = {}
    texts: dict[str, str] = {}
    for folder, each in (('test_piece/', test_piece(made)), ('', made)):
        parts = build(each)
        found |= {folder + name: data for name, data in _meshes(each, parts).items()}
        with matplotlib.rc_context(STYLE):
            views = section(exploded(each, parts))
            texts[f'{folder}making.html'] = _page(each, parts, views)
        listed = io.StringIO()
        csv.writer(listed, lineterminator='\n').writerows([HEADS, *rows(parts)])
        texts[f'{folder}parts.csv'] = listed.getvalue()
        progress(2 - bool(folder))
    texts['as_made.yaml'], texts['measurements.csv'] = as_made(made, parts), measurements(made)
    with matplotlib.rc_context(STYLE):
        sheet = drawing(made, parts)
        found |= {f'drawing.{kind}': rendered(sheet, kind, dpi=150) for kind in ('svg', 'pdf')}
    return found | {name: text.encode() for name, text in texts.items()}


def test_piece(made: Plan) -> Plan:
    """Return one pad, cast in the same process, for the bench."""
    foot, radius = made.foot, made.foot.pad.radius
    sole = max(radius + 1e-3 * made.edge + 2e-3, 6e-3)
    single = replace(foot, pads=1, sole_radius=sole, source=f'{foot.source}, one pad')
    given = made.given | {'mount_holes': 0, 'load': made.given.get('load', 0.0) / foot.pads}
    return plan(single, made.process, given)


def _meshes(made: Plan, parts: Mapping[str, Part]) -> dict[str, bytes]:
    found: dict[str, bytes] = {}
    for kind in PRINTED:
        printed = [part for part in parts.values() if part.made == kind]
        found |= {f'{part.name.replace(" ", "_")}.stl': stl(as_printed(part)) for part in printed}
        found[f'{kind}.3mf'] = three_mf(printed)
    holes = [(x, y, 1.5 + made.set['clearance']) for x, y in made.pegs(made.lid_angles)]
    rings = [(0.0, 0.0, made.r['sole']), (0.0, 0.0, made.r['outer'])]
    return found | {'spacer.dxf': dxf([*rings, *holes]).encode()}


def rows(parts: Mapping[str, Part]) -> list[list[str]]:
    """Return the printed parts and the spacer as texts, under :data:`HEADS`."""
    found = []
    for part in parts.values():
        if part.made in DENSITY:
            box, volume = part.solid.bounding_box(), 1e-3 * part.solid.volume()
            size = ' × '.join(f'{box[k + 3] - box[k]:.1f}' for k in range(3))
            values = f'{volume:.2f}', f'{1e-3 * volume * DENSITY[part.made]:.1f}'
            faces = str(part.solid.num_tri())
            found.append([part.name, part.made, size, *values, faces, part.bed])
    return found


def measurements(made: Plan) -> str:
    """Return the table to fill at the bench, which ``pad calibrate`` reads."""
    shares = (0.4, 0.55, 0.7, 0.85, 0.95, 0.7, 0.85, 0.95)  # five heights, three limits
    return (
        f'# One pad of {made.foot.source}. Heights from the side, by a camera, nothing touching.\n'
        '# Force limits: a plate on a scale, pressed until its gap to the sole is a sheet thick.\n'
        '# Fill in or delete each row, then:\n'
        '# pad calibrate measurements.csv --foot as_made.yaml --out my_foot.yaml\n'
        'pressure [kPa], height [mm], force_limit [N]\n'
    ) + ''.join(f'{1e-3 * share * ceiling_of(made):.3g}, ,\n' for share in shares)


# --- the page ------------------------------------------------------------------------------------


def _page(made: Plan, parts: Mapping[str, Part], views: str) -> str:
    escaped = [[html.escape(cell) for cell in row] for row in rows(parts)]
    title = f'Making {made.foot.source}'
    sections = [
        heading(title, (f'{made.process} process', f'{made.foot.pads} pads')),
        warning(_UNTRIED),
        views,
        '<h2>Parts to print and to cut</h2>' + table(HEADS, escaped, range(3, 6)),
        f'<h2>Silicone</h2>{_weighed(made, parts)}',
        *_work(made, parts),
        '<h2>What to expect</h2>' + _expectations(made),
    ]
    return page(title, sections)


def _weighed(made: Plan, parts: Mapping[str, Part]) -> str:
    body = []
    for material, casting, mass, mixed in batches(made, parts):
        times = f'{casting["pot_life"] / 60.0:.0f}', f'{casting["cure_time"] / 3600.0:.0f}'
        words = html.escape(f'{casting["mix"]}, at 23 °C; read the label. {casting["source"]}')
        half = f'{500.0 * mixed:.2f}'
        body.append([html.escape(material.name), f'{1e3 * mass:.2f}', half, half, *times, words])
    return table(_SILICONE, body, range(1, 6))


def _work(made: Plan, parts: Mapping[str, Part]) -> Iterator[str]:
    """Yield the steps of the work, and what goes wrong, from ``config/moulds``."""
    weigh, r = batches(made, parts), made.r
    lined = made.foot.pads * (r['hole'] ** 2 - r['pad'] ** 2) * made.set['bone']
    values: dict[str, object] = {
        'sheet': made.z['sheet'],
        'off': made.set['tolerance'],
        'sheet_of': made.sheet.name,
        'body': made.body.name,
        'heap': 1e-6 * math.pi * (lined + r['gasket'] ** 2) * weigh[-1].casting['density'],
        'screws': f'{made.screws} screws M{made.set["screw"]:g} × {made.screw_length:g}',
        'hole': 2.0 * r['hole'],
        'ceiling': 1e-3 * ceiling_of(made),
        'last': f'Screw the cap to the leg with {made.set["mount_holes"]:g} screws, 4 mm into its'
        f' holes on ⌀ {made.set["mount_circle"]:.1f}; the hose leaves through the middle.'
        if made.set['mount_holes']
        else 'Measure it as ../measurements.csv says, and run pad calibrate.',
    }
    for name, batch in (('sheet', weigh[0]), ('body', weigh[-1])):
        values[f'half_{name}'] = 500.0 * batch.mixed
        values[f'pot_{name}'] = batch.casting['pot_life'] / 60.0
        values[f'cure_{name}'] = batch.casting['cure_time'] / 3600.0
    path = shared_folder() / 'moulds' / f'{made.process}.md'
    for part in path.read_text(encoding='utf-8').format(**values).split('## ')[1:]:
        title, *steps = html.escape(part, quote=False).strip().split('\n- ')
        yield (
            f'<h2>{title.strip()}</h2><ol>'
            + ''.join(f'<li>{step}</li>' for step in steps)
            + '</ol>'
        )


def _expectations(made: Plan) -> str:
    foot, disc = made.foot, math.pi * made.r['sole'] ** 2 * made.z['sheet']
    head, *body = expected(made)
    assert made.sheet.casting is not None
    mass = 1e-6 * made.sheet.casting['density'] * disc
    words = (
        f'By the model of the foot, for a sheet that is {made.set["tolerance"]:g} mm off. All pads'
        ' share one plenum: the thinnest takes all the air once it balloons. The ceiling that'
        f' follows, {ceiling_of(made):.0f} Pa, is in as_made.yaml, for {foot.ceiling:.0f} Pa of'
        f' {foot.source}. A disc of the sheet of ⌀ {2.0 * made.r["sole"]:.0f} mm has {mass:.3f} g;'
        f' 0.01 g of that are {1.0 / mass:.1f} %. '
    )
    if made.process == 'small':
        bulge = made.bulge(made.z['top'] - made.z['sheet'])
        words += f'As a plate, the sole bulges by {bulge:.2g} mm at the ceiling.'
    else:
        words += (
            f'Only {made.z["bone"]:.1f} mm of silicone are under the bone, to hold the rims of'
            f' the pads; {foot.source} has {1e3 * foot.sole_thickness:g} mm, which land softly.'
        )
    if doubt := made.sheet.factor_range if foot.pad.material else None:
        words += f' The material may need {doubt[0]:g} to {doubt[1]:g} times these pressures.'
    return table(head, body, range(6)) + f'<p>{html.escape(words)}</p>'
