"""Messages on their way from one process of a run to another, as plain tuples.

Pickle takes several times as long for the messages themselves as for tuples of numbers and texts.
Of an image only what a detector finds in it goes along.
"""

from typing import Any, NamedTuple

from genie_sim.messages import (
    CameraPose,
    Detection,
    Detections,
    Header,
    Image,
    Look,
    Message,
    Motion,
)

Packed = tuple[Any, ...]
IMAGE_FIELDS = 8  # of a packed image; of packed detections one less


class SeenElsewhere(NamedTuple):
    """The content of an image that another process took: what a detector finds in it."""

    detections: tuple[Detection, ...]


def pack(message: Message) -> Packed:
    """A message as a tuple. Raises TypeError for one that is neither an image nor detections."""
    if isinstance(message, Image):
        image = message
        return (
            _packed_header(image.header),
            image.size_bytes,
            image.digest,
            image.dhash,
            tuple(image.pose),
            image.horizontal_fov_rad,
            _packed_all(image.content.detections),
            tuple([_packed_look(look) for look in image.looks]),
        )
    if isinstance(message, Detections):
        answer = message
        return (
            _packed_header(answer.header),
            _packed_all(answer.objects),
            answer.source,
            answer.served_by,
            None if answer.look is None else _packed_look(answer.look),
            answer.valid_ns,
            None if answer.seen_in is None else _packed_header(answer.seen_in),
        )
    raise TypeError(f"{type(message).__name__} cannot go to another process")


def unpack(packed: Packed) -> Message:
    """The message that ``pack`` was given."""
    if len(packed) == IMAGE_FIELDS:
        header, size_bytes, digest, dhash, pose, fov_rad, detections, looks = packed
        content = SeenElsewhere(_unpacked_all(detections))
        looks = tuple([_unpacked_look(look) for look in looks])
        pose = CameraPose(*pose)
        return Image(Header(*header), size_bytes, digest, dhash, pose, fov_rad, content, looks)
    header, objects, source, served_by, look, valid_ns, seen_in = packed
    look = None if look is None else _unpacked_look(look)
    seen_in = None if seen_in is None else Header(*seen_in)
    objects = _unpacked_all(objects)
    return Detections(Header(*header), objects, source, served_by, look, valid_ns, seen_in)


def _packed_header(header: Header) -> Packed:
    return header.stamp_ns, header.frame_id, header.origin


def _packed_all(detections: tuple[Detection, ...]) -> Packed:
    return tuple([_packed_detection(detection) for detection in detections])


def _packed_detection(detection: Detection) -> Packed:
    motion, seen_in = detection.motion, detection.seen_in
    return (
        detection.label,
        detection.score,
        detection.box,
        detection.location,
        detection.confidence,
        detection.method,
        None if motion is None else _packed_motion(motion),
        None if seen_in is None else _packed_header(seen_in),
    )


def _packed_motion(motion: Motion) -> Packed:
    velocity_mps, sigma_m, existence, seen, origins, signed = motion
    return velocity_mps, sigma_m, existence, _packed_header(seen), origins, signed


def _packed_look(look: Look) -> Packed:
    pose, fov_rad = tuple(look.pose), look.horizontal_fov_rad
    return _packed_header(look.header), pose, fov_rad, _packed_all(look.detections), look.signed


def _unpacked_all(packed: Packed) -> tuple[Detection, ...]:
    return tuple([_unpacked_detection(detection) for detection in packed])


def _unpacked_detection(packed: Packed) -> Detection:
    label, score, box, location, confidence, method, motion, seen_in = packed
    motion = None if motion is None else _unpacked_motion(motion)
    seen_in = None if seen_in is None else Header(*seen_in)
    return Detection(label, score, box, location, confidence, method, motion, seen_in)


def _unpacked_motion(packed: Packed) -> Motion:
    velocity_mps, sigma_m, existence, seen, origins, signed = packed
    return Motion(velocity_mps, sigma_m, existence, Header(*seen), origins, signed)


def _unpacked_look(packed: Packed) -> Look:
    header, pose, fov_rad, detections, signed = packed
    return Look(Header(*header), CameraPose(*pose), fov_rad, _unpacked_all(detections), signed)
