// A request for an action: JSON to and from the page's server. signal: of an AbortController; the server stops computing
// for an aborted request.
export async function post(path, keys, signal) {
  const response = await fetch(path, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(keys), signal });
  const answer = await response.json().catch(() => ({}));
  return { ok: response.ok, ...answer };
}
