"""What was really there: what consumers hold, and answers, compared with the truth.

``record.log`` hands over each frame (``published``) and each answer (``answered``), and at the end
says ``close``. Nothing is judged then and there: scenes are noted, and judged many at once, a
window, in numpy, by ``ConsumerJudge`` in ``consumers``::

    scenes      who looked from where at a window's instants, and what was in view then
    held        what the consumers held at these instants
    objects     objects of answers as columns
    joins       which held and visible objects are near each other, and which match
    recent_places   where objects were visible lately: what has moved away
    held_spans  for how long each object is held, or missed, in one place: table ``held_objects``

Rows go into the tables ``held`` and ``held_objects``. ``agreement`` compares answers with the
detector's own, without a truth: table ``answers``. ``tests/judge/scalar_judge.py`` judges the same
one object after the other, in plain Python: read it first, and change both.
"""
