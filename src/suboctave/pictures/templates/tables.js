// Tables: sorted by their headings, filtered by a text; rows that are points choose these.
const filtered = 6; // rows from which there is a filter

function startTables() {
  document.querySelectorAll("main table").forEach((table) => {
    const body = table.tBodies[0], rows = [...body.rows], heads = [...table.tHead.rows[0].cells];
    if (rows.length > 1) { heads.forEach((head, column) => sortable(head, column, heads, body, rows)); }
    if (rows.length >= filtered) { table.closest(".scroll").before(filterOf(table, rows)); }
    rows.filter((row) => row.dataset.place).forEach(pickable);
  });
}

function sortable(head, column, heads, body, rows) {
  const order = button(head.textContent, () => {
    const before = head.getAttribute("aria-sort");
    const next = { ascending: "descending", descending: null }[before] ?? (before === "descending" ? null : "ascending");
    heads.forEach((other) => other.removeAttribute("aria-sort"));
    if (next) { head.setAttribute("aria-sort", next); }
    const sign = next === "descending" ? -1 : 1;
    const key = (row) => row.cells[column].textContent.trim();
    const numeric = rows.every((row) => key(row) === "–" || Number.isFinite(parseFloat(key(row))));
    const value = (row) => (key(row) === "–" ? Infinity : parseFloat(key(row)));
    // a third time: in the order of before
    const sorted = !next ? rows : [...rows].sort((a, b) => sign * (numeric ? value(a) - value(b) : key(a).localeCompare(key(b))));
    body.append(...sorted);
  });
  head.replaceChildren(order);
}

function filterOf(table, rows) {
  const row = element("div", "", { class: "filter" }), count = element("span", "", { role: "status" });
  const input = element("input", "", { type: "search", placeholder: "filter rows", "aria-label": `Filter the rows of ${table.getAttribute("aria-label")}` });
  input.addEventListener("input", () => {
    const words = input.value.toLowerCase().split(/\s+/).filter(Boolean);
    rows.forEach((one) => { one.hidden = !words.every((word) => one.textContent.toLowerCase().includes(word)); });
    count.textContent = words.length ? `${rows.filter((one) => !one.hidden).length} of ${rows.length} rows` : "";
  });
  row.append(input, count);
  return row;
}

function pickable(row) {
  const [curve, vertex] = row.dataset.place.split(":").map(Number), first = row.cells[0];
  const pick = button(first.textContent, () => {});
  first.replaceChildren(pick);
  row.addEventListener("click", () => { if (!String(window.getSelection())) { choose(curve, vertex); } });
}

function markRows() {
  const place = chosen ? `${chosen.curve}:${chosen.vertex}` : "";
  document.querySelectorAll("tr[data-place]").forEach((row) => {
    const is = row.dataset.place === place;
    row.classList.toggle("chosen", is);
    row.setAttribute("aria-selected", String(is));
  });
}
