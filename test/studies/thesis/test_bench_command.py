# SPDX-License-Identifier: Apache-2.0
import json
import pathlib

import pytest
import yaml

from ros_pad import configuration
from ros_pad.errors import ConfigError
from studies.thesis.bench_command import main

pytestmark = pytest.mark.slow

FIGURES = {'inflation': (14, 15), 'press': (16, 17, 18), 'tangential': (20, 21, 10), 'foot': (34,)}


@pytest.mark.parametrize('kind', ['press'])
def test_json_and_files(kind, tmp_path, capsys):
    out = tmp_path / 'bench'
    assert main([f'bench_{kind}', '--json', '--out', str(out)]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed['scene'] == f'bench_{kind}' and printed['fidelity'] == 'analytic'
    for key in ('rows', 'claims', 'omitted'):
        assert printed[key]
    assert printed['report'] == str(out / 'report.html')
    names = [pathlib.Path(path).name for path in printed['figures']]
    assert names == [f'figure_{n}.{end}' for n in FIGURES[kind] for end in ('png', 'pdf')]
    kept = {'report.html', 'summary.json', *names}
    assert {path.name for path in out.iterdir()} == kept
    for path in printed['figures']:
        start = pathlib.Path(path).read_bytes()[:4]
        assert start == (b'\x89PNG' if path.endswith('png') else b'%PDF')
    assert json.loads((out / 'summary.json').read_text()) == printed


def test_a_foot_of_ones_own(tmp_path, capsys):
    """A foot with twice the stiffness has lower domes than measured."""
    shipped = configuration.shared_folder() / 'feet' / 'large19.yaml'
    values = yaml.safe_load(shipped.read_text())
    values['pad']['stiffness'] = 80.0
    foot = tmp_path / 'stiff.yaml'
    foot.write_text(yaml.safe_dump(values))
    out = str(tmp_path / 'bench')
    words = ['bench_inflation', '--json', '--foot', str(foot), '--out', out]
    with pytest.raises(ConfigError, match="force_limit = 'measured' is not allowed"):
        main(words)
    values['force_limit'] = 'thickness'
    foot.write_text(yaml.safe_dump(values))
    assert main(words) == 0
    rows = json.loads(capsys.readouterr().out)['rows']
    assert rows[0]['quantity'] == 'height' and rows[0]['error'] < -0.3
