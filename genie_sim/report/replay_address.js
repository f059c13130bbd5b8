// The address of an instant of the replay: #t=12.3&methods=remote,genie, seconds and the methods side by side.

function writeAddress(t, methods) {
  const names = methods.map(({ name }) => encodeURIComponent(name)).join(",");
  history.replaceState(null, "", `#t=${(t / 1e6).toFixed(3)}&methods=${names}`);
}

// The address of an instant of a fleet's map: #fleet=12.3&method=genie&layer=reuse.
function writeFleetAddress(seconds, method, layer) {
  history.replaceState(null, "", `#fleet=${seconds.toFixed(1)}&method=${encodeURIComponent(method)}&layer=${encodeURIComponent(layer)}`);
}
// What the page's address says of the map; null without an instant.
function readFleetAddress() {
  const fields = addressFields(), seconds = fields.has("fleet") ? Number(fields.get("fleet")) : NaN;
  if (!Number.isFinite(seconds)) return null;
  return { seconds, method: decoded(fields.get("method") ?? ""), layer: decoded(fields.get("layer") ?? "") };
}

// The instant and the methods of the page's address; names that the run does not have are left out. Null without an instant.
function readAddress(run) {
  const fields = addressFields();
  const t = fields.has("t") ? Number(fields.get("t")) * 1e6 : NaN;
  if (!Number.isFinite(t)) return null;
  const names = (fields.get("methods") ?? "").split(",").map(decoded);
  return { t, methods: [...new Set(names)].map((name) => run.methods.find((method) => method.name === name)).filter(Boolean) };
}
const addressFields = () => new Map(location.hash.slice(1).split("&").map((field) => field.split("=")));
function decoded(text) {
  try { return decodeURIComponent(text); } catch { return ""; }
}
