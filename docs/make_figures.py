"""
Draw the pictures of the tutorials and of the gallery, and write docs/gallery.md: what the programs really draw and print.

    .venv/bin/python docs/make_figures.py            # all: some minutes
    .venv/bin/python docs/make_figures.py gallery    # the examples alone
    .venv/bin/python docs/make_figures.py page       # docs/gallery.md alone, from the outputs that are there
"""

import ast
import contextlib
import io
import os
import runpy
import sys
import tempfile
from pathlib import Path

from PIL import Image

DOCS = Path(__file__).resolve().parent
sys.path[:0] = [str(DOCS.parent), str(DOCS.parent / "tests" / "docs")]
os.environ["MPLBACKEND"] = "Agg"

FIGURES = DOCS / "figures"
GALLERY = DOCS / "gallery.md"
TUTORIALS = {
    "controller_over_the_rail": {"rail.png": "tutorial_rail.png", "overview.png": "tutorial_controllers.png"},
    "measure_and_diagnose": {"tool_x.png": "tutorial_diagnosis.png"},
}
"""Pictures that a tutorial's programs draw, and their names here."""
EXAMPLES = (
    "machine_over_the_rail",
    "plants_over_the_rail",
    "pulses",
    "travelling_head",
    "absorber",
    "absorber_design",
    "controllers",
    "diagnose_a_campaign",
    "other_programs",
    "paper",
)
"""Examples in the order in which a reader meets them."""


def kept(picture: Path, name: str) -> None:
    """Store a picture small: somewhat wider than a page shows it, 128 colours of which none is lost for being rare."""
    image = Image.open(picture).convert("RGB")
    image.thumbnail((1200, 2400))
    target = FIGURES / name
    target.parent.mkdir(parents=True, exist_ok=True)
    image.quantize(128, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(target, optimize=True)
    print(f"written: {target.relative_to(DOCS.parent)}, {target.stat().st_size // 1024} kB")


@contextlib.contextmanager
def scratch():
    """A folder of its own to run in."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            yield Path(folder)
        finally:
            os.chdir(before)


def tutorials() -> None:
    """Run the tutorials and keep their pictures."""
    from test_pages import blocks, run

    for name, pictures in TUTORIALS.items():
        page = DOCS / "tutorials" / f"{name}.md"
        with scratch() as folder, contextlib.redirect_stdout(io.StringIO()):
            names: dict[str, object] = {"__name__": "page"}
            for block in blocks(page):
                run(block, page, names)
            made = {target: (folder / source).read_bytes() for source, target in pictures.items()}
        with scratch():
            for target, content in made.items():
                Path(target).write_bytes(content)
                kept(Path(target), target)


def gallery() -> None:
    """Run the examples; keep what they draw and print."""
    for name in EXAMPLES:
        with scratch() as folder, contextlib.redirect_stdout(io.StringIO()) as printed:
            runpy.run_path(str(DOCS.parent / "examples" / f"{name}.py"), run_name="__main__")
            (FIGURES / "gallery").mkdir(parents=True, exist_ok=True)
            (FIGURES / "gallery" / f"{name}.txt").write_text(printed.getvalue(), encoding="utf-8")
            with contextlib.redirect_stdout(sys.stderr):
                for picture in sorted(folder.glob("*.png")):
                    kept(picture, f"gallery/{name}-{picture.name}")


def gallery_page() -> str:
    """The gallery's page: each example's docstring, pictures, output and program."""
    lines = [
        "# Gallery",
        "",
        "The programs of `examples/`, what they draw and what they print. Each runs as it stands:",
        "`.venv/bin/python examples/NAME.py`. Pictures and outputs are of real runs, kept by `docs/make_figures.py`.",
        "",
    ]
    for name in EXAMPLES:
        said = ast.get_docstring(ast.parse((DOCS.parent / "examples" / f"{name}.py").read_text(encoding="utf-8"))) or ""
        about = said.partition("\n\n")[0].replace("\n", " ")
        lines += [f"## {name.replace('_', ' ').capitalize()}", "", about, ""]
        for picture in sorted((FIGURES / "gallery").glob(f"{name}-*.png")):
            what = picture.stem.partition("-")[2].replace("_", " ")
            lines += [f"![{name.replace('_', ' ')}: {what}](figures/gallery/{picture.name})", ""]
        printed = (FIGURES / "gallery" / f"{name}.txt").read_text(encoding="utf-8").rstrip()
        lines += ["It prints", "", "```text", *(line.rstrip() for line in printed.splitlines()), "```", ""]
        lines += [f"`examples/{name}.py`:", ""]
        lines += [f"```{{literalinclude}} ../examples/{name}.py", ":language: python", "```", ""]
    return "\n".join(lines).rstrip() + "\n"


if __name__ == "__main__":
    what = sys.argv[1] if len(sys.argv) > 1 else "all"
    if what in ("all", "tutorials"):
        tutorials()
    if what in ("all", "gallery"):
        gallery()
    if what in ("all", "gallery", "page"):
        GALLERY.write_text(gallery_page(), encoding="utf-8")
