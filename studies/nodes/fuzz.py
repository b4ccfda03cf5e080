# SPDX-License-Identifier: Apache-2.0
"""Fuzz the parsers of external input, guided by coverage.

Targets are replies of devices, fault texts, YAML, bags, and bytes of messages.

Needs atheris, which is no dependency of ros_pad: ``pip install atheris`` (CPython 3.11 to 3.13).
A parser may raise only errors of ros_pad.errors, and never return a pressure that is not finite.
An input that violates this is printed and saved as a file in ``--findings``; the exit status is
then not 0. ``python -m studies fuzz TARGET FILE`` runs such a file again, which does not need
atheris.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import importlib
import io
import math
import pathlib
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from ros_pad.errors import BadMessage, PadError
from studies import command

WATCHED = (
    'ros_pad.regulators.alicat',
    'ros_pad.regulators.serial_device',
    'ros_pad.regulators.serial_text',
    'ros_pad.simulation.faults',
    'ros_pad.configuration',
    'ros_pad.bags',
    'yaml',
    'mcap',
    'rosbags',
)
"""Modules, or packages, whose branches guide the search."""

LONGEST = 4096
"""Largest size of an input, bytes; twice the size of the longest seed if that is more."""

REPLY = 256  # largest number of bytes of a reply: ros_pad.regulators.serial_device.LONGEST_REPLY


@contextlib.contextmanager
def _watched_imports() -> Iterator[None]:
    """Instrument the modules that are imported in this block, if atheris is installed."""
    try:
        atheris = importlib.import_module('atheris')
    except ModuleNotFoundError:
        yield
        return
    with atheris.instrument_imports(include=list(WATCHED)):
        yield


@dataclasses.dataclass(frozen=True)
class Target:
    """A function that feeds a parser with bytes, and the first inputs.

    Attributes
    ----------
    feed : callable
        Takes the bytes. If the parser is right, it raises nothing but errors of ros_pad.
    seeds : list of bytes
        First inputs.
    """

    feed: Callable[[bytes], None]
    seeds: list[bytes]

    def __call__(self, data: bytes) -> None:
        """Feed the parser; raise any error that is not one of ros_pad."""
        with contextlib.suppress(PadError):
            self.feed(data)


def _device(backend: str) -> Target:
    """Return a target that identifies, sets and polls a device; replies are the lines of the data.

    As from a real device, a reply is ASCII, stripped, and at most :data:`REPLY` bytes long.
    """
    options, seeds = _DEVICES[backend]
    kind = importlib.import_module('ros_pad.regulators').BACKENDS[backend]

    def feed(data: bytes) -> None:
        regulator = kind(port='fuzz', **options)
        replies = iter(data.split(b'\n'))

        def ask(command: str, reply: bool = True) -> str:
            line = next(replies, None)
            if line is None:
                raise PadError('the input has no line left for this reply')
            return line[:REPLY].decode('ascii', 'ignore').strip() if reply else ''

        def check(frame: Any) -> None:
            for value in (frame.pressure, frame.resolution):
                if not math.isfinite(value):
                    raise AssertionError(f'{backend}: {value} in {frame} must be finite')
            if math.isinf(frame.setpoint):  # NaN means unknown
                raise AssertionError(f'{backend}: set-point in {frame} must be finite or NaN')
            regulator.in_force(frame, regulator.rounded(50e3, frame.resolution))

        check(regulator.identify(ask))
        for setpoint in (0.0, 50e3, 90e3):
            frame = regulator.send(ask, setpoint)
            check(frame or regulator.poll(ask))

    return Target(feed, seeds)


def _fault(data: bytes) -> None:
    from ros_pad.simulation.faults import Fault, parsed

    for fault in parsed([data.decode('utf-8', 'replace')]):
        if Fault.parse(str(fault)) != fault:
            raise AssertionError(f'{fault!r} has the text {str(fault)!r}, which is another fault')


def _file(load: Callable[[pathlib.Path], Any], name: str) -> Callable[[bytes], None]:
    folder = pathlib.Path(tempfile.mkdtemp(prefix='fuzz_'))

    def feed(data: bytes) -> None:
        path = folder / name
        path.write_bytes(data)
        load(path)

    return feed


def _read_bag(path: pathlib.Path) -> None:
    from ros_pad.bags import BagReader

    with warnings.catch_warnings():
        warnings.simplefilter('ignore')  # the reader warns of a bag that was not closed
        for _ in BagReader(path).messages():
            pass


def _bag(chunked: bool = True) -> bytes:
    """Return a small bag without checksums and compression, which random changes would break."""
    from mcap.writer import CompressionType, Writer

    stream = io.BytesIO()
    writer = Writer(
        stream, compression=CompressionType.NONE, enable_crcs=False, use_chunking=chunked
    )
    writer.start(profile='ros2')
    schema = writer.register_schema('std_msgs/msg/Float64', 'ros2msg', b'float64 data\n')
    channel = writer.register_channel('/value', 'cdr', schema)
    for time in (1, 2):
        writer.add_message(channel, time, bytes(12), time)
    writer.finish()
    return stream.getvalue()


_DEVICES: dict[str, tuple[dict[str, Any], list[bytes]]] = {
    'alicat': (
        {},
        [
            b'A +014.70 +000.00\nA 8v17.0-R23\n' + b'A +014.70 +000.00\n' * 4,
            b'A +1 +0 HLD LCK\nA 9v00\nA 7 psi\n' + b'A +1 +0 OPL EXH\nA ?\n?\n' * 3,
        ],
    ),
    'smc_itv': (
        {'full_scale': 100e3},
        [b'0\n12\n0\n0\n12\n512\n512\n510\n921\n921\n920', b'UNKNOWN COMMAND\n'],
    ),
    'serial_text': (
        {},
        [b'1 1.0\nOK 1 0.000\n1 1.0\nOK 1 2.500\n1 3.0\nOK 1 4.500\n1 4.6\n'],
    ),
}


def _faults() -> Target:
    return Target(_fault, [
        b'{kind: leak, legs: [2], start: 5.0, end: 20.0, conductance: 1.0e-10}',
        b'{kind: supply_loss, pressure: 1e3, time_constant: .5}',
        b'{kind: sensor_drift, offset: -5000, rise: 2}',
        b'{kind: force_range, load: 2.0}',
        b'{kind: !!str stuck_valve, start: 0x10, end: 1:30, legs: &a [1, 2]}',
        b'{kind: silence, start: 2001-12-14t21:59:43.10-05:00, end: !!float 7}',
    ])  # fmt: skip


def _shipped(folder: str) -> list[bytes]:
    from ros_pad.configuration import shared_folder

    return [path.read_bytes() for path in sorted((shared_folder() / folder).glob('*.yaml'))]


def _scenes() -> Target:
    with _watched_imports():
        from ros_pad.simulation.scene import Scene
    seeds = _shipped('scenes')[::-1]  # bench scenes come last, because Scene refuses them
    return Target(_file(Scene.load, 'scene.yaml'), seeds)


def _bags() -> Target:
    return Target(_file(_read_bag, 'bag.mcap'), [_bag(), _bag(chunked=False)])


def _records() -> Target:
    """Return a target that reads records of two legs; the first byte picks the kind."""
    import numpy as np

    from ros_pad.records import KINDS, Block

    with _watched_imports():
        from ros_pad.bags.wire import Wire

    wires = [Wire(kind, (1, 2)) for kind in KINDS]
    blocks = [Block(10**9 + np.arange(n), wire.kind.rows(n, 2)) for wire in wires for n in (1, 2)]

    def feed(data: bytes) -> None:
        wire, message = wires[data[0] % len(wires) if data else 0], data[1:]
        try:
            block = wire.decode(message)
        except BadMessage:
            raise
        except PadError as error:
            raise AssertionError('bytes of a message raise nothing but BadMessage') from error
        again = wire.decode(wire.encode(block))
        if again.rows.tobytes() != block.rows.tobytes():
            raise AssertionError(f'{block} is read as {again}')

    places = [place for place in range(len(wires)) for _ in range(2)]
    return Target(
        feed,
        [bytes([i]) + wires[i].encode(block) for i, block in zip(places, blocks, strict=True)],
    )


TARGETS: dict[str, Callable[[], Target]] = {
    **{name: functools.partial(_device, name) for name in _DEVICES},
    'faults': _faults,
    'scenes': _scenes,
    'bags': _bags,
    'records': _records,
}
"""Functions that make the targets, by name."""


def target(name: str) -> Target:
    """Return a target, with instrumented modules if atheris is installed."""
    with _watched_imports():
        for module in WATCHED:
            importlib.import_module(module)
    return TARGETS[name]()


def main(words: Sequence[str]) -> int:
    """Fuzz one target, or run one input again; return the exit status."""
    parser = command.parser('fuzz', __doc__)
    parser.add_argument('target', choices=list(TARGETS))
    parser.add_argument('file', nargs='?', type=pathlib.Path, help='one input to run again')
    parser.add_argument('--seconds', type=float, default=60.0, help='how long, s (default 60)')
    parser.add_argument(
        '--findings', type=pathlib.Path, default=pathlib.Path('fuzz_findings'), metavar='DIR',
        help='folder for inputs that raise other errors (default fuzz_findings)',
    )  # fmt: skip
    options = parser.parse_args(words)
    if options.file is not None:
        target(options.target)(options.file.read_bytes())
        command.show(options, {'found': False}, 'no error, or one of ros_pad: the parser is right')
        return 0
    try:
        atheris = importlib.import_module('atheris')
    except ModuleNotFoundError:
        raise PadError('atheris is not installed: pip install atheris') from None
    fuzzed = target(options.target)
    options.findings.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        for number, seed in enumerate(fuzzed.seeds):
            (pathlib.Path(folder) / str(number)).write_bytes(seed)
        longest = max(LONGEST, *(2 * len(seed) for seed in fuzzed.seeds))
        atheris.Setup(
            [
                sys.argv[0], folder,
                f'-max_total_time={round(options.seconds)}', f'-max_len={longest}',
                '-timeout=20', '-rss_limit_mb=2048', '-print_final_stats=1',
                f'-artifact_prefix={options.findings / options.target}_',
            ],
            fuzzed,
        )  # fmt: skip
        atheris.Fuzz()  # ends the process
    return 0
