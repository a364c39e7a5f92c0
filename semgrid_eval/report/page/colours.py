"""The class colours of a page: a colour-blind-safe palette, and the paper's for a reader who asks for it."""

from semgrid_eval.classes import CLASS_NAMES, class_palette


def class_style() -> str:
    """Write both palettes as CSS: properties `--class-0`, ..., the paper's under `:root[data-colours=paper]`.

    The page's script gives pictures the palette whose properties hold.
    """
    return "".join(
        f"{selector}{{{';'.join(f'--class-{i}:{hex_colour(colour)}' for i, colour in enumerate(palette))}}}"
        for selector, palette in (
            (":root", class_palette(safe=True).tolist()),
            (":root[data-colours=paper]", class_palette().tolist()),
        )
    )


def class_colours() -> tuple[tuple[str, str], ...]:
    """Name each class with its colour in whichever palette holds, for a legend."""
    return tuple((name.replace("_", " "), f"var(--class-{i})") for i, name in enumerate(CLASS_NAMES))


def hex_colour(colour: tuple[int, int, int]) -> str:
    """Write a colour as CSS does."""
    return "#{:02x}{:02x}{:02x}".format(*colour)
