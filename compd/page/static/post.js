// A request that wants something done: JSON to and from the page's server.
export async function post(path, keys) {
  const response = await fetch(path, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(keys) });
  const answer = await response.json().catch(() => ({}));
  return { ok: response.ok, ...answer };
}
