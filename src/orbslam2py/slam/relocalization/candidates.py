# SPDX-License-Identifier: BSD-3-Clause
"""The keyframes that a lost frame is compared with: a limited number, varied after each failure."""

from __future__ import annotations

import itertools
from dataclasses import replace

from orbslam2py import _core as core
from orbslam2py.slam.state import COVISIBLE_KEYFRAMES, LostSearch

_WORD_FRAMES = 3  # lost frames, the newest included, whose words name candidates
_WORD_CANDIDATES = 8  # named by words, that are matched with one frame: bounds its time
_NEAR_CANDIDATES = 4  # near the last known pose, that are matched with one frame


class CandidatePlaces:
    """Keyframes that may show the place of a lost frame.

    Parameters
    ----------
    slam_map : orbslam2py._core.Map
        The map.
    keyframe_index : orbslam2py._core.KeyFrameIndex
        Index from words to keyframes.
    """

    def __init__(self, slam_map: core.Map, keyframe_index: core.KeyFrameIndex) -> None:
        self._map = slam_map
        self._keyframe_index = keyframe_index

    def of(self, frame: core.Frame, lost: LostSearch) -> tuple[list[int], LostSearch]:
        """Choose keyframes for a frame with words.

        Parameters
        ----------
        frame : orbslam2py._core.Frame
            The frame, with its words.
        lost : LostSearch
            Where tracking was lost, and the searches since then.

        Returns
        -------
        list of int
            Ids, the most likely first, without repetition.
        LostSearch
            For the next frame.
        """
        lost = self._with_scores(frame, lost)
        named = self._by_words(lost)
        if len(named) < _WORD_CANDIDATES:
            named += self._around(named)
        by_words = _taken(named, _WORD_CANDIDATES, lost.failures)
        near = [] if lost.place is None else lost.place.keyframes(self._map)
        by_place = _taken(near, _NEAR_CANDIDATES, lost.failures)
        return list(dict.fromkeys(by_words + by_place)), lost

    def alike(self, keyframe: int) -> list[int]:
        """Return keyframes that look like a keyframe of the map and share no point with it.

        Ids, the most likely first, at most as many as for a frame.
        """
        found = core.find_loop_candidates(self._keyframe_index, self._map, keyframe, 0.0)
        ranked = sorted(found, key=lambda place: (-place.group_score, place.keyframe))
        return [place.keyframe for place in ranked[:_WORD_CANDIDATES]]

    def _with_scores(self, frame: core.Frame, lost: LostSearch) -> LostSearch:
        found = core.find_relocalization_candidates(self._keyframe_index, self._map, frame)
        scores = {place.keyframe: place.group_score for place in found}
        recent = (*lost.recent_scores, scores)[-_WORD_FRAMES:]
        return replace(lost, recent_scores=recent)

    def _by_words(self, lost: LostSearch) -> list[int]:
        """Return keyframes that look like one of the last frames; the most likely first.

        A lost camera moves continuously, so the scores of several frames are more reliable than
        one.
        """
        scores: dict[int, float] = {}
        for recent in lost.recent_scores:
            for keyframe, score in recent.items():
                scores[keyframe] = scores.get(keyframe, 0.0) + score
        living = [keyframe for keyframe in scores if self._map.has_keyframe(keyframe)]
        return sorted(living, key=lambda keyframe: (-scores[keyframe], keyframe))

    def _around(self, places: list[int]) -> list[int]:
        """Return other keyframes of these places, first those with most common points.

        The index gives the keyframe with the most similar words; the camera may be much nearer to
        another one.
        """
        n = COVISIBLE_KEYFRAMES
        neighbours = [self._map.best_neighbours(keyframe, n).tolist() for keyframe in places]
        in_turns = itertools.chain.from_iterable(itertools.zip_longest(*neighbours))
        named = {None, *places}
        return [keyframe for keyframe in dict.fromkeys(in_turns) if keyframe not in named]


def _taken(ranked: list[int], most: int, failures: int) -> list[int]:
    """Return the best half of `most`, and a half that moves on after each failure."""
    if len(ranked) <= most:
        return ranked
    always = most - most // 2
    others = ranked[always:]
    start = failures * (most // 2) % len(others)
    return ranked[:always] + (others + others)[start : start + most // 2]
