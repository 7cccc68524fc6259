"""The site of the documentation, for tools/site.sh. Pages, their order and the API's reference follow from the tree."""

import os
import pathlib
import re
from xml.etree import ElementTree

from docutils import nodes
from sphinx import addnodes
from sphinx.util.nodes import make_refnode

# What tools/site.sh makes of the checkout: this file on top, beside README.md by the name of index.md.
tree = pathlib.Path(__file__).parent
api = tree / "api"
xml = tree.parent / "xml"
include = tree / "framework/include"

project = "Sidestep"
copyright = "the authors of Sidestep"
extensions = ["myst_parser", "breathe"]
include_patterns = ["index.md", "CHANGELOG.md", "CONTRIBUTING.md", "docs/**", "api/**", "plugins/**", "tools/**"]
exclude_patterns = ["**/node_modules"]
html_theme = "furo"
html_title = project
html_copy_source = False
toc_object_entries = False
highlight_language = "none"
myst_heading_anchors = 4
breathe_projects = {project: str(xml)}
breathe_default_project = project
breathe_show_include = False
nitpick_ignore_regex = [("cpp:.*", ".*")]  # other libraries' types


def pages(*patterns):
    """The pages that match, in the order in which docs/README.md names them."""
    table = (tree / "docs/README.md").read_text()
    order = {f"docs/{link}": place for place, link in enumerate(re.findall(r"\]\((.+?)\)", table))}
    found = [str(path.relative_to(tree)) for pattern in patterns for path in sorted(tree.glob(pattern))]
    return [path.rsplit(".", 1)[0] for path in sorted(found, key=lambda path: order.get(path, -1))]


def contents(caption, documents):
    listed = [f"/{document}" for document in documents]
    return "\n".join(["", "```{toctree}", ":hidden:", f":caption: {caption}", "", *listed, "```", ""])


def move_members():
    """Moves what is in a namespace to its header, where Breathe looks for it, and leaves out what is private.

    Returns Doxygen's names for the headers.
    """
    trees = {path: ElementTree.parse(path) for path in xml.glob("*sidestep*.xml")}
    trees |= {path: ElementTree.parse(path) for path in xml.glob("*_8hpp.xml")}
    files = {}
    for parsed in trees.values():
        compound = parsed.getroot()[0]
        for part in compound.findall("*[@prot='private']") + compound.findall("sectiondef"):
            if part.get("prot") or part.get("kind").startswith("private"):
                compound.remove(part)
        if compound.get("kind") == "file":
            files[compound.find("location").get("file")] = compound
            for namespace in compound.findall("innernamespace"):
                compound.remove(namespace)
    for parsed in trees.values():
        compound = parsed.getroot()[0]
        if compound.get("kind") != "namespace":
            continue
        for section in compound.findall("sectiondef"):
            by_file = {}
            for member in section.findall("memberdef"):
                member.find("name").text = member.find("qualifiedname").text
                by_file.setdefault(member.find("location").get("file"), []).append(member)
            for file, members in by_file.items():
                ElementTree.SubElement(files[file], "sectiondef", kind=section.get("kind")).extend(members)
    for path, parsed in trees.items():
        parsed.write(path)
    return {name: compound.get("id") for name, compound in files.items()}


def write_api():
    """A page for each folder of public headers, a section for each header."""
    api.mkdir()
    for folder in sorted(path for path in include.glob("sidestep/*") if path.is_dir()):
        title = f"sidestep/{folder.name}"
        lines = [title, "=" * len(title), ""]
        for name in sorted(name for name in labels if name.startswith(f"sidestep/{folder.name}/")):
            lines += [f".. _{labels[name]}:", "", name, "-" * len(name), "", f".. doxygenfile:: {name}", ""]
        (api / f"{folder.name}.rst").write_text("\n".join(lines))


def add_contents(app, document, text):
    """What is below a page in the site's contents; and README.md by its other name."""
    up = "../" * document.count("/")
    text[0] = text[0].replace(f"]({up}README.md", f"]({up}index.md")
    below = {
        "index": [("Overview", pages("docs/*.md")), ("Tutorials", pages("docs/tutorials/*.md")),
                  ("Reference", pages("docs/reference/*.md")), ("C++ API", pages("api/*.rst")),
                  ("Studies", pages("docs/studies/*.md")),
                  ("Project", ["docs/decisions/README", "CHANGELOG", "CONTRIBUTING"])],
        "docs/decisions/README": [("Decisions", pages("docs/decisions/0*.md"))],
        "docs/tutorials/write_a_plugin": [("Templates", pages("plugins/template/*/README.md"))],
        "docs/reference/plugins": [("Plugins", pages("plugins/[!t]*/**/README.md"))],
        "CONTRIBUTING": [("Tools", pages("tools/**/README.md"))],
    }
    for caption, documents in below.get(document, []):
        text[0] += contents(caption, documents)


def link_names(app, doctree):
    """Headers and classes that a page names lead to the reference; names of other libraries lead nowhere."""
    for xref in list(doctree.findall(addnodes.pending_xref)):
        if re.match(r"(std|Eigen|tl)\b", xref["reftarget"]):
            xref.replace_self(xref.children)
    for name in list(doctree.findall(nodes.literal)):
        text = name.astext().removeprefix("sidestep/")
        target = labels.get(f"sidestep/{text}") or (re.fullmatch(r"[A-Z]\w+", text) and f"sidestep::{text}")
        if not target or isinstance(name.parent, nodes.reference | addnodes.pending_xref):
            continue
        domain, kind = ("cpp", "identifier") if "::" in target else ("std", "ref")
        xref = addnodes.pending_xref("", name.deepcopy(), refdomain=domain, reftype=kind, reftarget=target,
                                     refexplicit=True, refdoc=app.env.docname)
        name.replace_self(xref)


def link_to_folder(app, env, node, shown):
    """A link to a folder leads to its README; a folder without one is only named."""
    folder = (tree / node["refdoc"]).parent / node["reftarget"]
    if not folder.is_dir():
        return None
    page = os.path.relpath(folder / "README", tree)
    return make_refnode(app.builder, node["refdoc"], page, "", shown) if page in env.found_docs else shown


def setup(app):
    app.connect("source-read", add_contents)
    app.connect("doctree-read", link_names)
    app.connect("missing-reference", link_to_folder)


labels = move_members()
write_api()
