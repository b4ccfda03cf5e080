# SPDX-License-Identifier: Apache-2.0
"""All files that make a foot: meshes, drawing, parts list, steps, and the foot as it is made."""

from __future__ import annotations

import csv
import html
import io
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import matplotlib

from ros_pad.contact import Foot
from ros_pad.contact.layout import edge_of
from ros_pad.contact.resistance import DOMED
from ros_pad.making import Part, Plan, build
from ros_pad.making.expect import DENSITY, Batch, as_made, batches, ceiling_of, expected
from ros_pad.making.files import dxf, stl, three_mf
from ros_pad.making.plan import plan, process_of
from ros_pad.making.solids import as_printed
from ros_pad.pace import Progress
from ros_pad.reports.mould_drawings import drawing, exploded
from ros_pad.reports.page import heading, page, plain_table, section, table
from ros_pad.reports.style import STYLE, rendered

PRINTED = ('filament', 'resin')
HEADS = ('part', 'of', 'size, mm', 'volume, cm³', 'mass, g', 'triangles', 'on the bed')
_ON_BED = {
    'lid': 'flat face down, pegs up',
    'ring': 'face with the groove down',
    'inner mould': 'plate down, pins up; no supports on the pins',
    'bone': 'flange down',
    'cap': 'flat top down, open side up',
    'retainer': 'flat face down',
    'spacer': 'cut from film by spacer.dxf, not printed',
}


def files(made: Plan, progress: Progress = lambda _: None) -> dict[str, bytes]:
    """Return all files of a foot by name.

    Parameters
    ----------
    made : Plan
        The foot.
    progress : callable
        Is told how many of seven steps are done.

    Raises
    ------
    InvalidInput
        When its test piece cannot be made.
    PadError
        When manifold3d is not installed.
    """
    parts = build(made)
    progress(1)
    piece = test_piece(made)
    found = _meshes(made, parts, '') | _meshes(piece, build(piece), 'test_piece/')
    progress(2)
    with matplotlib.rc_context(STYLE):
        sheet, views = drawing(made, parts), exploded(made, parts)
        progress(3)
        found |= {f'drawing.{kind}': rendered(sheet, kind, dpi=150) for kind in ('svg', 'pdf')}
        progress(5)
        found['what_goes_where.png'] = rendered(views.figure, 'png', dpi=150)
        progress(6)
        texts = {
            'making.html': page(
                f'Making {made.foot.source}', _sections(made, parts, section(views))
            ),
            'parts.csv': _csv([HEADS, *rows(parts)]),
            'measurements.csv': measurements(made),
            'as_made.yaml': as_made(made, parts),
            'dimensions.json': json.dumps(dimensions(made), indent=1),
        }
    return found | {name: text.encode() for name, text in texts.items()}


def test_piece(made: Plan) -> Plan:
    """Return one pad, cast in the same process, for the bench."""
    foot = made.foot
    least = foot.pad.radius + edge_of(foot.pad.radius) + 2e-3
    single = replace(foot, pads=1, sole_radius=max(least, 6e-3), source=f'{foot.source}, one pad')
    given = {name: value for name, value in made.given.items() if name != 'bone'}
    return plan(single, made.process, given)


def _meshes(made: Plan, parts: Mapping[str, Part], folder: str) -> dict[str, bytes]:
    printed = [part for part in parts.values() if part.made in PRINTED]
    found = {
        f'{folder}{part.name.replace(" ", "_")}.stl': stl(as_printed(part)) for part in printed
    }
    found[f'{folder}printed.3mf'] = three_mf(printed)
    holes = [(x, y, 1.5 + made.set['clearance']) for x, y in made.pegs(made.lid_angles)]
    rings = [(0.0, 0.0, made.r['sole']), (0.0, 0.0, made.r['outer'])]
    return found | {f'{folder}spacer.dxf': dxf([*rings, *holes]).encode()}


def rows(parts: Mapping[str, Part]) -> list[list[str]]:
    """Return the printed parts and the spacer as texts, under :data:`HEADS`."""
    found = []
    for part in parts.values():
        if part.made not in DENSITY:
            continue
        box, volume = part.solid.bounding_box(), 1e-3 * part.solid.volume()
        size = ' × '.join(f'{box[k + 3] - box[k]:.1f}' for k in range(3))
        grams = f'{1e-3 * volume * DENSITY[part.made]:.1f}'
        found.append(
            [part.name, part.made, size, f'{volume:.2f}', grams, str(part.solid.num_tri()),
             _ON_BED[part.name]]
        )  # fmt: skip
    return found


def dimensions(made: Plan) -> dict[str, object]:
    """Return the dimensions as plain values, mm."""
    return {
        'foot': made.foot.source,
        'process': made.process,
        'pitch_mm': made.pitch if math.isfinite(made.pitch) else None,
        'heights_mm': made.z,
        'radii_mm': made.r,
        'screws': made.screws,
        'peak_load_n': made.load,
        'ceiling_pa': ceiling_of(made),
        'settings_mm_n_degrees': made.set,
    }


def measurements(made: Plan) -> str:
    """Return the table to fill at the bench, which ``pad calibrate`` reads."""
    kpa = 1e-3 * ceiling_of(made)
    lines = [
        f'# One pad of {made.foot.source}. Fill in the heights (dial gauge) and the force limits (on',
        '# a scale), delete rows without a value, then:',
        '# pad calibrate measurements.csv --foot as_made.yaml --out my_foot.yaml',
        'pressure [kPa], height [mm], force_limit [N]',
        *(f'{share * kpa:.3g}, ,' for share in (0.4, 0.55, 0.7, 0.85, 0.95)),
        *(f'{share * kpa:.3g}, ,' for share in (0.7, 0.85, 0.95)),
    ]
    return '\n'.join(lines) + '\n'


def _csv(lines: Sequence[Sequence[str]]) -> str:
    stream = io.StringIO()
    csv.writer(stream, lineterminator='\n').writerows(lines)
    return stream.getvalue()


# --- the page --------------------------------------------------------------------------------------


def _sections(made: Plan, parts: Mapping[str, Part], views: str) -> Iterator[str]:
    """Yield the parts of the page."""
    foot, weigh = made.foot, batches(made, parts)
    yield heading(f'Making {foot.source}', (f'{made.process} process', f'{foot.pads} pads'))
    yield f'<p class="warning">{html.escape(_UNTRIED)}</p>'
    yield views
    yield '<h2>Parts to print and to cut</h2>'
    yield table(HEADS, [[html.escape(cell) for cell in row] for row in rows(parts)], range(3, 6))
    yield '<h2>Silicone</h2>'
    yield table(_SILICONE, [_weighed(each) for each in weigh], range(1, 6))
    yield '<h2>Work</h2>'
    steps = _large(made, weigh) if made.process == 'large' else _small(made, weigh)
    yield '<ol>' + ''.join(f'<li>{html.escape(step)}</li>' for step in steps) + '</ol>'
    yield '<h2>What goes wrong</h2>' + plain_table(_FAULTS)
    yield '<h2>What to expect</h2>' + _expectations(made)


_UNTRIED = (
    'No foot was made by these files yet: they were modelled, checked and sliced. Cast the test'
    ' piece first.'
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
_FAULTS = (
    (
        'A pad stays flat',
        'Its channel is blocked by silicone: push a wire through from the plenum.',
    ),
    (
        'One pad grows before all others',
        'Its sheet is thin there, or holds a bubble. Vent at once.',
    ),
    ('Air leaves at the rim of a pad', 'The sheet did not bond, or release agent got between.'),
    ('Air leaves at the cap', 'The seal is dirty or a screw loose: it is squeezed by a fifth.'),
    (
        'Silicone is sticky at the pins',
        'The resin stopped its cure: wash, cure and lacquer again.',
    ),
    ('Sheet too thick all over', 'The lid was not pressed down, or flash lies under the spacer.'),
)


def _weighed(each: Batch) -> list[str]:
    casting, half = each.material.casting, f'{500.0 * each.mixed:.2f}'
    assert casting is not None
    return [
        html.escape(each.material.name),
        f'{1e3 * each.mass:.2f}',
        half,
        half,
        f'{casting.pot_life / 60.0:.0f}',
        f'{casting.cure_time / 3600.0:.0f}',
        html.escape(f'{casting.mix}, at 23 °C; read the label. {casting.source}'),
    ]


def _first(made: Plan) -> list[str]:
    """Return the steps that both processes begin with."""
    off, thick = made.set['tolerance'], made.z['sheet']
    return [
        'Print the parts as listed: filament in layers of 0.2 mm or less, resin of 0.05 mm.',
        f'Cut the spacer from polyester film of {thick:g} mm, or of films that add up to it. The'
        ' sheet becomes as thick as this film: measure it with a micrometer.',
        'Wash and post-cure the inner mould, then two thin coats of clear acrylic lacquer: resin can'
        ' keep silicone from curing. Try a drop of the silicone on its back first.',
        'Fit dry: the ring goes on the plate in one way only. With a dial gauge, the ends of the pins'
        f' must be level with the ring’s face within {off:g} mm. If they are lower, sand the face on'
        ' glass; if higher, put paper under the ring.',
        'Put release agent on plate, ring, lid and the ends of the pins, and nowhere else. Stick'
        ' clear film on the lid: it makes the sole smooth.',
    ]


def _mix(each: Batch) -> str:
    half, casting = 500.0 * each.mixed, each.material.casting
    assert casting is not None
    return (
        f'Weigh {half:.2f} g of each part of {each.material.name} (scale of 0.01 g), mix for three'
        f' minutes and degas. It must be poured within {casting.pot_life / 60.0:.0f} minutes.'
    )


def _cure(each: Batch) -> str:
    casting = each.material.casting
    assert casting is not None
    return f'leave it for {casting.cure_time / 3600.0:.0f} hours at 23 °C.'


_LAST = (
    'Tap the hole of the cap to M5, screw in the fitting of the hose with sealant.',
    'Under water at 10 kPa or a tenth of the ceiling: no bubbles, and every pad rises. Then the'
    ' test piece: fill measurements.csv at the bench, and run pad calibrate.',
)


def _large(made: Plan, weigh: Sequence[Batch]) -> list[str]:
    mix, holes = weigh[0], made.foot.pads * (made.r['hole'] ** 2 - made.r['pad'] ** 2)
    first = math.pi * (holes * made.set['bone'] + made.r['gasket'] ** 2)  # mm³
    casting = mix.material.casting
    assert casting is not None
    return [
        *_first(made),
        _mix(mix),
        f'Fill the recess of the plate and heap up {1e-6 * first * casting.density:.1f} g between the'
        ' pins. Push the bone over the pins until it lies on the plate: silicone must come up around'
        ' every pin. (From above it would not run down there in time.)',
        'Set the ring, pour from one side until the pins are covered, and degas again.',
        f'Lay the spacer on the ring, lower the lid from one side, weigh it down with 1 kg, and'
        f' {_cure(mix)}',
        'Take off lid and spacer, draw the ring off towards the sole, then the inner mould straight'
        ' along its pins, slowly: air must get in, or suction tears the sheet. Trim the vents.',
        f'Screw the cap on the bone with {made.screws} screws M{made.set["screw"]:g} until it touches'
        ' the bone: this squeezes the seal by 0.2 mm.',
        *_LAST,
    ]


def _small(made: Plan, weigh: Sequence[Batch]) -> list[str]:
    sheet, body = weigh[0], weigh[-1]
    return [
        *_first(made),
        _mix(body),
        'Set the ring, pour around the pins until they are covered, degas, lower the lid without the'
        f' spacer from one side, weigh it down with 1 kg, and {_cure(body)}',
        'Take off the lid, and leave the body on its pins. Wipe the ends of the pins clean, and put'
        ' release agent on them alone; clean the body with alcohol.',
        _mix(sheet),
        'Lay the spacer on the ring, pour over the body, degas, lower the lid from one side, weigh it'
        f' down with 1 kg, and {_cure(sheet)}',
        'Take off lid and spacer, draw the ring off towards the sole, then the inner mould straight'
        ' along its pins, slowly: air must get in, or suction tears the sheet. Trim the vents.',
        'Put the retainer over the sole up to the flange, and screw the cap on it with'
        f' {made.screws} screws M{made.set["screw"]:g} until they touch: this squeezes the flange by'
        ' 0.4 mm.',
        *_LAST,
    ]


def _expectations(made: Plan) -> str:
    foot = made.foot
    body = [
        [
            f'{1e3 * each.thickness:.3f}',
            f'{each.stiffness:.3g}',
            f'{each.pressure:.0f}',
            _or_none(1e3 * each.height),
            _or_none(each.force_limit),
            f'{each.largest:.0f}',
        ]
        for each in expected(made)
    ]
    head = ('sheet, mm', 'stiffness, N/m', 'for the same dome, Pa')
    head += (f'dome at {DOMED * foot.ceiling:.0f} Pa, mm', f'limit at {foot.ceiling:.0f} Pa, N')
    words = [
        f'By the model of the foot, for a sheet that is {made.set["tolerance"]:g} mm off. All pads'
        ' share one plenum: the thinnest takes all the air once it balloons. The ceiling that'
        f' follows is {ceiling_of(made):.0f} Pa (that of {foot.source}: {foot.ceiling:.0f} Pa), and'
        ' as_made.yaml has it.',
        f'Weigh the sheet: on glass, one of ⌀ {2.0 * made.r["sole"]:.0f} mm has'
        f' {_sheet_mass(made):.3f} g, and 0.01 g are {1.0 / _sheet_mass(made):.1f} % of it.',
    ]
    if made.process == 'small':
        words.append(
            f'The sole has no bone: as a plate it bulges by {made.bulge:.2g} mm at the ceiling.'
        )
    else:
        words.append(
            f'Only {made.z["bone"]:.1f} mm of silicone are under the bone, so that it holds the rims of'
            f' the pads; the file of {foot.source} has {1e3 * foot.sole_thickness:g} mm, which land'
            ' more softly.'
        )
    return table((*head, 'balloons or model ends, Pa'), body, range(6)) + ''.join(
        f'<p>{html.escape(each)}</p>' for each in words
    )


def _or_none(value: float) -> str:
    return 'balloons' if math.isnan(value) else f'{value:.3g}'


def _sheet_mass(made: Plan) -> float:
    """Return the mass of a disc of the sheet, g."""
    casting = made.sheet.casting
    assert casting is not None
    return 1e-6 * casting.density * math.pi * made.r['sole'] ** 2 * made.z['sheet']


__all__ = ['files', 'process_of', 'test_piece']
