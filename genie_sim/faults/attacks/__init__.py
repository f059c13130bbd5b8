"""Attacks: faults in which a car or an edge tells what is not so, one file each
(``attack.Attack``). Metrics of them are in ``analysis.attacks``, defences in ``core.defences``.
"""
