"""The words of an episode's page, each with what it means, for readers who have not read the paper."""

from __future__ import annotations

from dataclasses import dataclass

from sonar_explore.episodes.record import EpisodeRecord


@dataclass(frozen=True)
class Word:
    """An entry of the page's glossary."""

    id: str
    """`word-` and this is its anchor."""
    term: str
    meaning: str


WORDS = (
    Word(
        "feature",
        "Feature",
        "What a scan is taken to have heard: a wall, which is the line that it shows, a corner (×) or an edge (○).",
    ),
    Word(
        "chain",
        "Chain",
        "Walls of one straight line, each of them a link, heard by one scan after another. The heavy link is the "
        "root, to which the others are held.",
    ),
    Word(
        "root",
        "P(root)",
        "How sure the robot was of its own place when the chain began: 1 in the first scan, later the mean P(root) of "
        "the chains that the scan recognised, half of that where it recognised none. It does not say that "
        "the wall is there: a false wall, heard from a well-known place, has 1.00 as well. What has one link "
        "was heard once and never again.",
    ),
    Word(
        "dangling",
        "Dangling",
        "Begun by a scan that recognised nothing, so that where it lies hangs on the wheels alone, until a scan "
        "recognises it together with a chain that does not dangle and the two are merged.",
    ),
    Word(
        "association",
        "Association",
        "A wall of this scan, taken for the chain that it would continue. The link graph cuts those that do not "
        "agree with the others; those kept correct the pose.",
    ),
    Word("adr", "ADR", "Angle from the wall of the scan to the chain's root, before the correction."),
    Word(
        "ndr",
        "NDR",
        "Distance from the middle of the wall to the root's line, once turned parallel to it, before the correction.",
    ),
    Word(
        "p",
        "P",
        "How sure the association is: how many others turned by as much as it did, how near the end of the link is, "
        "how near it lies to their mean. The correction weighs it by this.",
    ),
    Word(
        "pose",
        "Predicted, corrected, true",
        "Where the wheels put the robot, where it believes it is once it has recognised walls, and where it is. "
        "“Off” is the distance and the angle to the true pose.",
    ),
    Word(
        "explored",
        "Explored",
        "Share of the area that the robot can reach that lay within 2 m of a true scan position and in its sight.",
    ),
    Word(
        "walls",
        "Walls on the map",
        "Share of the wall length in reach that was drawn within 10 cm; below it, how far drawn cells lie from "
        "true walls in the mean.",
    ),
    Word("false-free", "False-free", "Share of the cells drawn as free that are in a wall or behind one."),
    Word(
        "candidates",
        "Candidate",
        "A place from which a scan would show something new. Its score is the sum of the terms beside it, in the "
        "policy's own units; the policy takes the highest.",
    ),
    Word(
        "then",
        "At a scan",
        "Map, walls and ways are shown as the robot had them then; marks of earlier scans stay where they were made, "
        "even where the robot has since moved them.",
    ),
)

TERMS = {
    "new_area": "area that a scan would show for the first time",
    "associations": "how sure the chains are that should answer there",
    "travel": "length of the way, which counts against it",
    "missing_link": "a dangling chain and one that does not dangle should answer there together",
    "underway": "it is where the last leg was going",
    "chance": "drawn at random",
}
"""The terms of the shipped policies."""


def glossary(record: EpisodeRecord) -> list[Word]:
    """The words that the page of this record needs."""
    decisions = [step.decision for step in record.steps if step.decision]
    named = dict.fromkeys(term for d in decisions for c in d.candidates for term in c.terms)
    terms = [f"{term.replace('_', ' ')}: {TERMS[term]}" for term in named if term in TERMS]
    told = "; ".join(terms)
    return [
        Word(word.id, word.term, f"{word.meaning} Here: {told}.")
        if word.id == "candidates" and terms
        else word
        for word in WORDS
    ]
