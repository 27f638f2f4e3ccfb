"""Text dumps of scenes, as far as two hosts can mean the same by them."""

import re

# Settings are what a test asks its host for; purposes and products are lines of the command alone.
HOSTS_OWN = re.compile(r"settings|purposes |product ")
UNSEEN = {"  invisible", "  nothing to render"}
UNKNOWN = re.compile(
    # Hydra knows subsets of faces alone, and those only where materials are bound to them.
    r"  (subset |warning (topology|unsupported): /)"
    # USD's fallback, which some hosts give where nothing is authored: it is not taken for a wish.
    r"|  nonlinear samples 3$"
    # Hydra does not say that the number of points changes with the topology's.
    r"|  warning time-samples: point samples differ in length"
)


def blocks(text: str) -> dict[str, list[str]]:
    """The lines below each heading, without what hosts cannot agree on and what is not seen."""
    text = text[text.index("hdtrapeze dump 1") :]
    found = {}
    for block in text.split("\n\n")[1:]:
        heading, *lines = block.strip().split("\n")
        if heading.startswith("curves "):  # which have no sides
            lines = [line for line in lines if line != "  double sided"]
        if not HOSTS_OWN.match(heading) and UNSEEN.isdisjoint(lines):
            found[heading] = [line for line in lines if not UNKNOWN.match(line)]
    return found


def placements(text: str) -> list[tuple[str, str]]:
    """When and where instancers place their copies, in some order: hosts number instances and split
    instancers by prototypes each in its own way."""
    return sorted(re.findall(r"^    \d+(?: at (.*))?: (\(\(.*\)\))$", text, re.MULTILINE))
