"""Methods: what a scenario compares, one file each (``sim.method``), found by name here or as
``package.module:Class``. It may import ``base``, ``core`` and ``sim``.
"""

METHODS: dict[str, str] = {
    "local": "genie_sim.methods.local:Local",
    "remote": "genie_sim.methods.remote:Remote",
    "paced_remote": "genie_sim.recommended.paced_remote:PacedRemote",
    "genie": "genie_sim.methods.genie:Genie",
    "recommended": "genie_sim.recommended.method:Recommended",
    "central": "genie_sim.methods.central:Central",
    "sim_lru": "genie_sim.methods.sim_lru:SimLRU",
    "rnd_lru": "genie_sim.methods.sim_lru:RndLRU",
    "potluck": "genie_sim.methods.potluck:Potluck",
    "foggycache": "genie_sim.methods.foggycache:FoggyCache",
    "cachier": "genie_sim.methods.cachier:Cachier",
    "deadline": "genie_sim.methods.deadline:Deadline",
    "oracle": "genie_sim.methods.oracle:Oracle",
}
DEFAULT_METHODS = ("local", "remote", "genie")  # what a scenario compares if it does not say
MUST_HAVE = ("title", "baseline", "on_car", "on_edge")
