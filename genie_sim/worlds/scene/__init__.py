"""What the worlds share, a town and recorded traffic: objects, what a camera has in view of them,
and what a detector that was fitted on real pictures finds of that.

How it fits together, from the scenario to a picture:

- The *source* (``town.source``, ``traffic.source``) has the settings, and opens a *scene*
  (``scene.Scene``: a seed, objects, where they are at any time, the laws of the detector) and the
  *drives* through it (``scene.SceneDrives``).
- A *drive* (``frames.SceneDrive``) is one car on its *course* (``frames.Course``: where it is at
  any time) with two cameras, whose frames are made when they are looked at.
- Of one camera, up to 64 *frames* that follow each other are a *batch* (``frames.FrameBatch``):
  their poses are computed together (``view.ViewPoses``), then what is in view from these
  (``view.VisibleObjects``, by the scene's ``visibility``), then what is detected of that
  (``detector.DetectedObjects``, by the scene's ``detector``), each when it is first asked for.
- The *truth* (``scene.SceneTruth``) tells whoever judges what is in view in a frame, and whether
  there is anything of a class at a place.

All of these are columns: tuples of arrays of one length, an entry for each thing. Four numbers say
which thing, and are called the same everywhere:

========= ============================================================================
``index`` a frame among all of its camera's drive
``pose``  a frame, or the pose that it is taken from, in its batch: 0 to 63
``row``   an object in the scene's ``objects.ObjectColumns``
``group`` a group of laws in ``laws.Copula``: one for each of vehicles, persons, ghosts
========= ============================================================================

So ``visible.row[k]`` is in view from ``visible.pose[k]``; there are as many ``k`` as objects are in
view from all poses, ordered by pose and then by row. Places are east and north [m] of the scene's
zero, headings are [rad] counter-clockwise from east and come as ``cos`` and ``sin`` where they are
only used to turn, times are [s] of the scene's clock (``scene_ns`` and ``start_ns`` in [ns]).

Nothing is drawn in an order: every random number follows from a key (``keys``), so that a frame is
the same whoever looks at it, and when. The keys are of the scene's random numbers and seed, of an
object, and of a frame's car, camera and time, and of no setting: other settings change what is
there, and the same car sees the same object from the same place at the same time with the same
luck. A scene's ``digest`` tells it from others, in ids of runs and digests of pictures, and decides
nothing else.
"""
