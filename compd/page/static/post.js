// A request that wants something done: JSON to and from the page's server. signal: of an AbortController; what the server
// computes for a request that was aborted ends there, too.
export async function post(path, keys, signal) {
  const response = await fetch(path, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(keys), signal });
  const answer = await response.json().catch(() => ({}));
  return { ok: response.ok, ...answer };
}
