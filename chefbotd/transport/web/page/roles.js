// What the token lets this page do: what it may not ask for is as good as absent.

const $ = (id) => document.getElementById(id);
const RANKS = ["observe", "drive", "admin"];
const MAY = { observe: "watch and stop", drive: "drive" };

// The daemon's capabilities without the methods that this role may not use.
export async function permitted(connection, capabilities, role) {
  $("role-part").hidden = !MAY[role];
  $("role").textContent = MAY[role] ?? "";
  if (!MAY[role]) return capabilities;
  const { methods } = await connection.request("describe");
  const rank = RANKS.indexOf(role);
  const refused = Object.entries(methods).filter(([, { role: needed }]) => RANKS.indexOf(needed) > rank);
  const left = new Set(capabilities);
  for (const [name] of refused) left.delete(`method.${name}`);
  return left;
}
