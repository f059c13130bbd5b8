"""Methods: the schemes that a scenario compares. One file each, found by name here or as ``package.module:Class``.

A method imports ``core`` and ``sim`` and says what stands on each host (``sim.station``); the runner makes it.
"""

METHODS: dict[str, str] = {
    "local": "genie_sim.methods.local:Local",
    "remote": "genie_sim.methods.remote:Remote",
    "genie": "genie_sim.methods.genie:Genie",
    "central": "genie_sim.methods.central:Central",
    "sim_lru": "genie_sim.methods.sim_lru:SimilarityLRU",
    "rnd_lru": "genie_sim.methods.sim_lru:RandomLRU",
    "potluck": "genie_sim.methods.potluck:AdaptiveThreshold",
    "foggycache": "genie_sim.methods.foggycache:Foggy",
    "cachier": "genie_sim.methods.cachier:EdgeOfCloud",
    "deadline": "genie_sim.methods.deadline:Deadline",
    "oracle": "genie_sim.methods.oracle:Oracle",
}
USUAL = ("local", "remote", "genie")  # what a scenario compares if it does not say
MUST_HAVE = ("title", "baseline", "on_car", "on_edge")
