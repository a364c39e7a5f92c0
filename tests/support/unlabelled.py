"""Recordings as they come without labels."""

from dataclasses import replace

from semgrid_eval.recording.types import Recording


def unlabelled(recording: Recording) -> Recording:
    """The same recording without the label images of its cameras."""

    def moments():
        for moment in recording.moments():
            cameras = {name: replace(frame, label_png=None) for name, frame in moment.cameras.items()}
            yield replace(moment, cameras=cameras)

    return replace(recording, moments=moments)
