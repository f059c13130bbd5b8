// The address of an instant of the replay: #t=12.3&methods=remote,genie, seconds and the methods side by side.

function writeAddress(t, methods) {
  const names = methods.map(({ name }) => encodeURIComponent(name)).join(",");
  history.replaceState(null, "", `#t=${(t / 1e6).toFixed(3)}&methods=${names}`);
}

// The instant and the methods of the page's address; names that the run does not have are left out. Null without an instant.
function readAddress(run) {
  const fields = new Map(location.hash.slice(1).split("&").map((field) => field.split("=")));
  const t = fields.has("t") ? Number(fields.get("t")) * 1e6 : NaN;
  if (!Number.isFinite(t)) return null;
  const names = (fields.get("methods") ?? "").split(",").map(decoded);
  return { t, methods: [...new Set(names)].map((name) => run.methods.find((method) => method.name === name)).filter(Boolean) };
}
function decoded(text) {
  try { return decodeURIComponent(text); } catch { return ""; }
}
