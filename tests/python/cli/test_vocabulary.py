# SPDX-License-Identifier: BSD-3-Clause
"""The vocabulary subcommands as a person types them."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from orbslam2py import load_vocabulary
from support.vocabularies import TEXT


@pytest.fixture
def run(command):
    """Run the subcommand; gives the exit code, what was printed and what was complained."""

    def call(*arguments: object) -> tuple[int, str, str]:
        done = command("vocabulary", *arguments)
        return done.code, done.out, done.err

    return call


@pytest.fixture
def images(tmp_path) -> Path:
    folder = tmp_path / "images"
    folder.mkdir()
    rng = np.random.default_rng(1)
    for i in range(3):
        image = cv2.resize(rng.integers(0, 256, (24, 32), np.uint8), (320, 240))
        cv2.imwrite(str(folder / f"{i}.png"), image)
    return folder


def test_train_and_info(run, images, tmp_path):
    target = tmp_path / "mine.bvoc"
    options = ("--branching", 5, "--depth", 2, "--features", 200, "--note", "A licence.")
    code, out, _ = run("train", images, "-o", target, *options)
    assert code == 0
    words = load_vocabulary(target).n_words
    assert f"{words} words from 3 images" in out
    code, out, _ = run("info", target)
    assert code == 0
    assert str(words) in out
    assert "5, 2" in out
    assert "on 3 images with 200 features each, seed 0. A licence." in out


def test_convert_there_and_back(run, tmp_path):
    assert run("convert", TEXT, tmp_path / "v.bvoc")[0] == 0
    assert run("convert", tmp_path / "v.bvoc", tmp_path / "v.txt", "--quiet")[:2] == (0, "")
    expected = load_vocabulary(TEXT, cache=False).hash
    assert load_vocabulary(tmp_path / "v.txt", cache=False).hash == expected


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["info", "nothing.bvoc"], "nothing.bvoc: No such file"),
        (["info", __file__], "not a vocabulary"),
        (["convert", TEXT, "v.bin"], "must end with .bvoc"),
        (["convert", TEXT, TEXT], "use --force"),
        (["convert", TEXT, "no/folder/v.bvoc"], "no such folder"),
        (["train", "nowhere", "-o", "v.bvoc"], "give a folder of photographs"),
        (["train", ".", "-o", "v.bvoc", "--branching", 1], "branching"),
        (["train", "nowhere"], "Missing option"),
        (["train", ".", "-o", "v.bvoc", "--seed", -1], "seed"),
    ],
)
def test_mistakes_give_a_message_and_exit_code_2(run, images, arguments, complaint):
    code, _, err = run(*arguments)
    assert code == 2
    assert complaint in err
    assert not Path("v.bvoc").exists()


def test_existing_files_are_replaced_with_force_only(run, tmp_path):
    target = tmp_path / "v.bvoc"
    target.write_text("precious")
    assert run("convert", TEXT, target)[0] == 2
    assert target.read_text() == "precious"
    assert run("convert", TEXT, target, "--force")[0] == 0
    assert load_vocabulary(target).n_words == 1000


@pytest.mark.parametrize("verb", ["train", "convert", "info"])
def test_help_has_an_example(run, verb):
    code, out, _ = run(verb, "--help")
    assert code == 0
    assert f"orbslam2py vocabulary {verb} " in out
