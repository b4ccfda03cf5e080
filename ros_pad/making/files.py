# SPDX-License-Identifier: Apache-2.0
"""Files for printers and cutters: STL, 3MF and DXF, in millimetres."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from xml.sax.saxutils import quoteattr

import numpy as np

from ros_pad.making.solids import Part, Solid, as_printed

_OPC, _OOXML = 'http://schemas.openxmlformats.org/package/2006/', 'application/vnd.'
_3MF = 'http://schemas.microsoft.com/3dmanufacturing/'
_PACKAGE = {
    '[Content_Types].xml': f'<Types xmlns="{_OPC}content-types"><Default Extension="rels"'
    f' ContentType="{_OOXML}openxmlformats-package.relationships+xml"/><Default Extension="model"'
    f' ContentType="{_OOXML}ms-package.3dmanufacturing-3dmodel+xml"/></Types>',
    '_rels/.rels': f'<Relationships xmlns="{_OPC}relationships"><Relationship Id="r0"'
    f' Target="/3D/3dmodel.model" Type="{_3MF}2013/01/3dmodel"/></Relationships>',
}


def stl(solid: Solid) -> bytes:
    """Return a solid as a binary STL file."""
    mesh = solid.to_mesh()
    corners = np.asarray(mesh.vert_properties)[:, :3][np.asarray(mesh.tri_verts)]
    rows = np.zeros(len(corners), np.dtype([('n', '<3f4'), ('p', '<9f4'), ('flags', '<u2')]))
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    rows['n'] = normals / np.maximum(np.linalg.norm(normals, axis=1), 1e-30)[:, None]
    rows['p'] = corners.reshape(-1, 9)
    return b'ros_pad, mm'.ljust(80) + len(rows).to_bytes(4, 'little') + rows.tobytes()


def three_mf(parts: Iterable[Part]) -> bytes:
    """Return parts as they are printed, side by side, as one 3MF file."""
    objects, left = [], 0.0
    for number, part in enumerate(parts, 1):
        solid = as_printed(part)
        x, y, _, far, _, _ = solid.bounding_box()
        mesh = solid.translate((left - x, -y, 0.0)).to_mesh()
        left += far - x + 5.0
        points, faces = mesh.vert_properties[:, :3].tolist(), mesh.tri_verts.tolist()
        corner, face = (
            '<vertex x="{:.6f}" y="{:.6f}" z="{:.6f}"/>',
            '<triangle v1="{}" v2="{}" v3="{}"/>',
        )
        objects.append(
            f'<object id="{number}" type="model" name={quoteattr(part.name)}><mesh><vertices>'
            + ''.join(corner.format(*each) for each in points)
            + '</vertices><triangles>'
            + ''.join(face.format(*each) for each in faces)
            + '</triangles></mesh></object>'
        )
    items = ''.join(f'<item objectid="{number}"/>' for number, _ in enumerate(objects, 1))
    model = (
        '<?xml version="1.0" encoding="UTF-8"?><model unit="millimeter" xml:lang="en"'
        f' xmlns="{_3MF}core/2015/02"><resources>{"".join(objects)}</resources>'
        f'<build>{items}</build></model>'
    )
    return zipped(_PACKAGE | {'3D/3dmodel.model': model})


def zipped(files: Mapping[str, str | bytes]) -> bytes:
    """Return files by name as a ZIP; the same files give the same bytes."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, 'w', zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(zipfile.ZipInfo(name), data, zipfile.ZIP_DEFLATED)
    return stream.getvalue()


def dxf(circles: Sequence[tuple[float, float, float]]) -> str:
    """Return circles (x, y, radius in mm) as a DXF drawing, for a plotter or a laser cutter."""
    rows = ['0\nSECTION\n2\nHEADER\n9\n$INSUNITS\n70\n4\n0\nENDSEC', '0\nSECTION\n2\nENTITIES']
    rows += [
        f'0\nCIRCLE\n8\n0\n10\n{x:.4f}\n20\n{y:.4f}\n30\n0.0\n40\n{radius:.4f}'
        for x, y, radius in circles
    ]
    return '\n'.join([*rows, '0\nENDSEC', '0\nEOF\n'])
