# SPDX-License-Identifier: Apache-2.0
"""The site that `make docs` and rosdoc2 build from this folder.

Pages are written for a forge as well. So links to files that are no pages go to the repository,
and the contents at the side are made from the lists of links on the pages of ``SECTIONS``.
"""

import os
import pathlib
import re
import sys
import xml.etree.ElementTree

import numpy.typing
from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.domains.python import PyObject
from sphinx.pycode import ModuleAnalyzer
from sphinx.util.typing import stringify_annotation

# rosdoc2 runs a copy of this file in another folder; the package is one of its arguments.
ARGUMENTS = [pathlib.Path(os.environ.get('PWD', ''), each) for each in sys.argv]
ROOT = next(
    folder
    for folder in (*pathlib.Path(__file__).resolve().parents, *ARGUMENTS)
    if (folder / 'package.xml').exists()
).resolve()
DOCS = ROOT / 'docs'
sys.path.insert(0, str(ROOT))
PACKAGE = xml.etree.ElementTree.parse(ROOT / 'package.xml').getroot()
REPOSITORY = PACKAGE.findtext("url[@type='repository']").strip()
SECTIONS = ('tutorials/README', 'how_to', 'model/README', 'reference', 'api/README', 'evidence')
# Pages of the site that are files outside of this folder.
OUTSIDE = {
    'bags': 'bags/README.md',
    'changelog': 'CHANGELOG.md',
    'contributing': 'CONTRIBUTING.md',
    'quality': 'QUALITY_DECLARATION.md',
    'readme': 'README.md',
}

project = 'ros_pad'
release = version = PACKAGE.findtext('version')
author = PACKAGE.findtext('maintainer')
copyright = f'{author}, {PACKAGE.findtext("license")}'

extensions = [
    'myst_parser',
    'sphinx.ext.autodoc',
    'sphinx.ext.napoleon',
    'sphinx.ext.viewcode',
]
source_suffix = {'.md': 'markdown'}
exclude_patterns = ['standard_docs']  # made by rosdoc2
root_doc = 'index'
highlight_language = 'text'
html_theme = 'furo'
html_title = f'ros_pad {version}'
html_static_path = ['static']
html_css_files = ['site.css']
html_show_sphinx = False
html_copy_source = False
html_math_renderer = 'mathml'

myst_heading_anchors = 6
myst_enable_extensions = ['dollarmath']

autodoc_default_options = {'members': True, 'member-order': 'bysource'}
autodoc_typehints_format = 'short'
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 88
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False

# Types in docstrings are words ("float or array"), fields stand in lists. All other names of
# ros_pad must exist.
nitpicky = True
nitpick_ignore_regex = [
    (r'py:(class|attr)', r'(?!ros_pad\.).*'),
    (r'py:\w+', r'(?!ros_pad)\w+\..*'),
]


def read_page(app, docname, source):
    """Change the text of a page: links, contents, and what the code knows."""
    text, file = source[0], DOCS / f'{docname}.md'
    if docname in OUTSIDE:
        file = ROOT / OUTSIDE[docname]
        text = file.read_text(encoding='utf-8')
    if docname in SECTIONS:
        listed = re.findall(r'^- \[([^]]*)\]\(([^)#]+)\.md\)', text, re.MULTILINE)
        pages = [page if title.endswith('.md') else f'{title} <{page}>' for title, page in listed]
        text += '\n'.join(['', '```{toctree}', ':hidden:', '', *pages, '```', ''])
    if docname == 'examples':  # the code, which a forge shows behind its link
        pictures = r'^!\[[^]]*\]\(charts/example_(\w+)\.png\)$'
        code = r'\g<0>\n\n```{literalinclude} ../examples/\1.py\n:language: python\n```'
        text = re.sub(pictures, code, text, flags=re.MULTILINE)
    if docname == 'options':
        text += ''.join(helps())
    links = re.compile(r'\]\(([^)\s#:]+)(?=[)#])')
    here = (DOCS / docname).parent
    text = links.sub(lambda link: f']({address(file.parent / link[1], here)}', text)
    page = pathlib.Path(app.srcdir, docname)
    source[0] = re.sub(
        r'(?<={literalinclude} )\S+',
        lambda each: os.path.relpath(file.parent / each[0], page.parent),
        text,
    )


def address(path, here):
    """Return the link from a page in ``here`` to a file: on the site, or in the repository."""
    path = path.resolve()
    name = path.relative_to(ROOT).as_posix()
    for docname, file in OUTSIDE.items():
        if name == file:
            path = DOCS / f'{docname}.md'
    if path.is_relative_to(DOCS) and path.suffix in ('.md', '.png'):
        return os.path.relpath(path, here)
    return f'{REPOSITORY}/{"tree" if path.is_dir() else "blob"}/main/{name}'


def helps():
    """Yield the help of every command."""
    from ros_pad import cli

    os.environ['COLUMNS'] = '88'
    for command in cli.COMMANDS:
        (group,) = cli.parser(command)._subparsers._group_actions
        yield f'\n## pad {command}\n\n```text\n{group.choices[command].format_help()}```\n'


def skip_fields(app, what, name, member, skip, options):
    """Leave out fields of named tuples, which their docstrings list."""
    return True if type(member).__name__ == '_tuplegetter' else None


def describe(app, what, name, value, options, lines):
    """Give a constant the text below its assignment in any module of its package."""
    if what == 'data':
        package, _, short = name.rpartition('.')
        lines.clear()  # the text of its type
        for module in sorted(each for each in sys.modules if f'{each}.'.startswith(f'{package}.')):
            texts = ModuleAnalyzer.for_module(module).find_attr_docs()
            if ('', short) in texts and getattr(sys.modules[module], short) is value:
                lines[:] = texts['', short]


def shorten(app, what, name, value, options, signature, returned):
    """Name the types of arrays as the code does."""
    array_like = stringify_annotation(numpy.typing.ArrayLike, 'smart')

    def short(text):
        text = text and text.replace(array_like, 'ArrayLike')
        return text and re.sub(
            r'~numpy\.ndarray\[.*?, ~numpy\.dtype\[(.*?)\]\]', r'NDArray[\1]', text
        )

    protocol = signature == '(*args, **kwargs)'
    return '' if protocol else short(signature), short(returned)


def find(app, env, node, content):
    """Return a link to a name that is written without its package, or is in the code alone."""
    name = node.get('reftarget', '')
    near = [each for each in env.domains['py'].objects if each.endswith(f'.{name}')]
    if len(near) == 1:
        return env.domains['py'].resolve_xref(
            env, node['refdoc'], app.builder, 'obj', near[0], node, content
        )
    docstring = re.search(r'docstring of ([\w.]+)', node.source or '')
    if docstring and '.' not in name:
        module = docstring[1]
        while module not in sys.modules:
            module = module.rpartition('.')[0]
        name = f'{module}.{name}' if hasattr(sys.modules[module], name) else name
    while name.startswith('ros_pad.'):
        path = name.replace('.', '/') + '.py'
        if (ROOT / path).exists():
            return nodes.reference('', '', content, refuri=f'{REPOSITORY}/blob/main/{path}')
        name = name.rpartition('.')[0]
    return None


def math(writer, node):
    """Write an equation as MathML, which browsers draw without a script of another site."""
    block = isinstance(node, nodes.math_block)
    text = tex2mathml(node.astext(), as_block=block)
    writer.body.append(f'<div class="equation">{text}</div>' if block else text)
    raise nodes.SkipNode


def setup(app):
    """Connect the functions above, and name the fields of classes as NumPy does."""
    for field in PyObject.doc_field_types:
        field.label = {'variable': 'Attributes'}.get(field.name, field.label)
    app.connect('source-read', read_page)
    app.connect('autodoc-skip-member', skip_fields)
    app.connect('autodoc-process-docstring', describe)
    app.connect('autodoc-process-signature', shorten)
    app.connect('missing-reference', find)
    app.add_html_math_renderer('mathml', (math, None), (math, None))
