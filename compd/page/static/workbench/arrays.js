// Numbers from the page's server: a line of JSON that names the arrays, then float32.
export async function fetchArrays(path) {
  const response = await fetch(path);
  if (!response.ok) throw new Error((await response.json()).reason);
  const bytes = new Uint8Array(await response.arrayBuffer());
  const end = bytes.indexOf(10);
  const header = JSON.parse(new TextDecoder().decode(bytes.subarray(0, end)));
  let begin = end + 1;
  const arrays = {};
  for (const { name, shape } of header.arrays) {
    const count = shape.reduce((a, b) => a * b, 1);
    arrays[name] = new Float32Array(bytes.buffer.slice(begin, begin + 4 * count));
    begin += 4 * count;
  }
  return { ...header, ...arrays, shapes: Object.fromEntries(header.arrays.map(({ name, shape }) => [name, shape])) };
}
