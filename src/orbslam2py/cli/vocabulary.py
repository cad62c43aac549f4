# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py vocabulary``: train, convert and inspect vocabularies."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

from orbslam2py import _core as core
from orbslam2py._arguments import seed_of
from orbslam2py._version import __version__
from orbslam2py.cli.targets import check_target
from orbslam2py.errors import VocabularyError
from orbslam2py.vocabulary import (
    convert_vocabulary,
    read_training_images,
    save_vocabulary,
    train_vocabulary,
    vocabulary_info,
)

app = typer.Typer(
    help="Train, convert and inspect vocabularies.",
    no_args_is_help=True,
    rich_markup_mode="markdown",
)
Quiet = Annotated[bool, typer.Option("--quiet", help="Only errors.")]


@contextmanager
def _progress_bar(console: Console) -> Iterator[Callable[[str, float], None]]:
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn())
    with Progress(*columns, TimeElapsedColumn(), console=console, transient=True) as bar:
        tasks: dict[str, int] = {}

        def show(step: str, fraction: float) -> None:
            if step not in tasks:
                tasks[step] = bar.add_task(step, total=1.0)
            bar.update(tasks[step], completed=fraction)  # type: ignore[arg-type]

        yield show


def train(
    images: Annotated[Path, typer.Argument(help="Folder with images, searched with subfolders.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="File to write: .bvoc, .txt or .txt.gz.")
    ],
    branching: Annotated[int, typer.Option(help="Children per node.", min=2, max=20)] = 10,
    depth: Annotated[
        int, typer.Option(help="Levels; at most branching^depth words.", min=1, max=10)
    ] = 5,
    features: Annotated[int, typer.Option(help="Features per image.", min=1, max=1_000_000)] = 2000,
    seed: Annotated[int, typer.Option(min=0, help="Of the random generator.")] = 0,
    threads: Annotated[
        int, typer.Option(help="0: one per core. The result does not depend on it.", min=0, max=256)
    ] = 0,
    note: Annotated[
        str, typer.Option(help="Kept in a .bvoc file: licence, where the images come from.")
    ] = "",
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
    quiet: Quiet = False,
) -> None:
    """Train a vocabulary on a folder of images."""
    _check_target(output, force=force)
    options = core.TrainingOptions()
    options.branching = branching
    options.depth = depth
    options.seed = seed_of(seed)
    options.n_threads = threads
    paths = read_training_images(images)
    comment = (
        f"Trained by orbslam2py {__version__} on {len(paths)} images with {features} features "
        f"each, seed {seed}. {note}"
    ).strip()

    console = Console(quiet=quiet)
    begin = time.perf_counter()
    with _progress_bar(console) as show:
        vocabulary = train_vocabulary(
            paths, options, features=core.OrbOptions(n_features=features), progress=show
        )
        if vocabulary is None:
            raise VocabularyError("the training was cancelled")
        save_vocabulary(vocabulary, output, comment=comment)
    console.print(
        f"{vocabulary.n_words} words from {len(paths)} images are in "
        f"[bold]{escape(str(output))}[/] ({output.stat().st_size / 1e6:.1f} MB, "
        f"{time.perf_counter() - begin:.0f} s)",
        highlight=False,
        soft_wrap=True,
    )


def convert(
    source: Annotated[Path, typer.Argument(help="Vocabulary in any format, also packed.")],
    target: Annotated[Path, typer.Argument(help="File to write: .bvoc, .txt or .txt.gz.")],
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
    quiet: Quiet = False,
) -> None:
    """Convert a vocabulary between the binary and the text format."""
    _check_target(target, force=force)
    console = Console(quiet=quiet)
    with _progress_bar(console) as show:
        vocabulary = convert_vocabulary(
            source, target, progress=lambda fraction: show("Converting", fraction)
        )
    console.print(
        f"{vocabulary.n_words} words are in [bold]{escape(str(target))}[/]",
        highlight=False,
        soft_wrap=True,
    )


def info(
    path: Annotated[
        Path | None, typer.Argument(help="Vocabulary in any format; default: the package's.")
    ] = None,
) -> None:
    """Check a vocabulary and show its properties."""
    facts = vocabulary_info(path)
    console = Console(highlight=False, soft_wrap=True)
    for name, value in (
        ("path", facts.path),
        ("format", facts.format.value),
        ("size", f"{facts.size / 1e6:.2f} MB"),
        ("branching, depth", f"{facts.branching}, {facts.depth}"),
        ("scoring, weighting", f"{facts.scoring}, {facts.weighting}"),
        ("nodes", f"{facts.n_nodes} (with the root)"),
        ("words", f"{facts.n_words} ({facts.n_stopped} of weight 0)"),
        ("sha256", facts.sha256),
        ("comment", facts.comment),
    ):
        console.print(f"{name:20}{value}", markup=False)


def _check_target(path: Path, *, force: bool) -> None:
    if not path.name.endswith((".bvoc", ".txt", ".txt.gz")):
        raise VocabularyError(f"{path}: the name must end with .bvoc, .txt or .txt.gz")
    check_target(path, force=force)


EXAMPLE = "{}\n\n**Example**\n\n    orbslam2py vocabulary {}\n"
train.__doc__ = EXAMPLE.format(train.__doc__, "train photographs -o mine.bvoc --depth 5")
convert.__doc__ = EXAMPLE.format(convert.__doc__, "convert ORBvoc.txt.tar.gz ORBvoc.bvoc")
info.__doc__ = EXAMPLE.format(info.__doc__, "info ORBvoc.bvoc")
app.command("train")(train)
app.command("convert")(convert)
app.command("info")(info)
