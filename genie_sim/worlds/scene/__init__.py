"""What the worlds share, a town and recorded traffic: objects, what a camera has in view of them,
and what a detector that was fitted on real pictures finds of that.

How it fits together, from the scenario to a picture:

- The *source* (``town.source``, ``traffic.source``) has the settings, and opens a *scene*
  (``scene.Scene``: a seed, objects, where they are at any time, the laws of the detector) and the
  *drives* through it (``source.SceneDrives``).
- A *drive* (``frames.SceneDrive``) is one car on its *course* (``frames.Course``: where it is at
  any time) with two cameras, whose frames are made when they are looked at.
- Of one camera, up to 64 *frames* that follow each other are a *batch* (``frames.FrameBatch``):
  their poses are computed together (``view.ViewPoses``), then what is in view from these
  (``view.VisibleObjects``, by the scene's ``visibility``), then what is detected of that
  (``detector.DetectedObjects``, by the scene's ``detector``), each when it is first asked for, and
  kept as long as a frame of the batch.
- The *truth* (``source.SceneTruth``) tells whoever judges what is in view in a frame, and whether
  there is anything of a class at a place.

A car drives, and its left camera looks at its first frame:

>>> from genie_sim.worlds.town.rules import TownRules
>>> from genie_sim.worlds.town.town import Town
>>> town = Town(TownRules(blocks=(2, 2)), seed=1)
>>> frame = town.drive("car1", duration_ns=2_000_000_000).frames["02"][0]
>>> [thing.label for thing in frame.truth() if thing.moving]
['bicycle', 'person', 'person']
>>> [(detection.label, detection.score) for detection in frame.detections[:2]]
[('car', 0.862), ('person', 0.784)]

What to change where: what there is, in the world's own room; what is in view of it, ``view`` and
the world's ``visibility``; what a detector makes of that, ``detector``, and how likely, ``laws``;
which bits of a key are which random number, ``keys`` alone; and nothing in ``kept_words``. What a
world of one's own has to give, ``scene.Scene`` says, and ``tests/conformance/scenes.py`` tests.

All of these are columns: tuples of arrays of one length, an entry for each thing. Four numbers say
which thing, and are called the same everywhere, as are four distances:

=========== ===========================================================================
``index``   a frame among all of its camera's drive
``slot``    a frame in its batch (0 to 63), or a place among those asked about at once
``row``     an object in the scene's ``objects.ObjectColumns``
``group``   a group of laws in ``laws.Copula``: one for each of vehicles, persons, ghosts
``away_m``  how far away an object is
``view_m``  how far a detector looks
``range_m`` up to where objects are judged; in ``laws.json``, middles of bins of distances
``sight_m`` up to where it is known what is in view: the farther of these two
=========== ===========================================================================

So ``visible.row[k]`` is in view in ``visible.slot[k]``; there are as many ``k`` as objects are in
view in all slots, ordered by slot and then by row. An array's shape is given by what it has an
entry for: ``(slots,)``, ``(objects,)``, ``(groups,)``, or ``(n,)`` for such pairs. Places
are east and north [m] of the scene's zero, headings are [rad] counter-clockwise from east and come
as ``cos`` and ``sin`` where they are only used to turn, times are [s] of the scene's clock
(``scene_ns`` and ``start_ns`` in [ns]).

Nothing is drawn in an order: every random number follows from a key (``keys``), so that a frame is
the same whoever looks at it, and when. The keys are of the scene's random numbers and seed, of an
object, and of a frame's car, camera and time, and of no setting: other settings change what is
there, and the same car sees the same object from the same place at the same time with the same
luck. A scene's ``digest`` tells it from others, in ids of runs and digests of pictures, and decides
nothing else.
"""
