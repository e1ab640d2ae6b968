"use strict";
// The table of permutations: thousands of rows are sorted and filtered as data, and only as many
// as a reader looks at become elements.

const PAGE = 40;
const { columns, rows } = JSON.parse(document.getElementById("permutation-data").textContent);
const table = document.getElementById("permutations");
const filter = document.getElementById("permutation-filter");
const method = document.getElementById("permutation-method");
const count = document.getElementById("permutation-count");
const more = document.getElementById("permutation-more");
const state = { column: -1, descending: false, shown: PAGE };
const METHOD = 2;

function chosen() {
  const words = filter.value.toLowerCase().split(/\s+/).filter(Boolean);
  const found = rows.filter(
    (row) =>
      (!method.value || row[METHOD] === method.value) &&
      words.every((word) => row[0].toLowerCase().includes(word)),
  );
  if (state.column >= 0) {
    const sign = state.descending ? -1 : 1;
    const [i, numeric] = [state.column, columns[state.column].digits !== null];
    found.sort((a, b) => sign * (numeric ? a[i] - b[i] : a[i] < b[i] ? -1 : a[i] > b[i] ? 1 : 0));
  }
  return found;
}

function cell(value, column) {
  const td = document.createElement("td");
  if (column.digits === null) {
    td.textContent = value;
    return td;
  }
  td.className = "number";
  if (column.share) {
    const bar = document.createElement("span");
    bar.className = "bar";
    bar.setAttribute("aria-hidden", "true");
    bar.append(document.createElement("i"));
    bar.firstChild.style.width = `${100 * value}%`;
    td.append(bar);
  }
  td.append(value.toFixed(column.digits));
  return td;
}

function draw() {
  const found = chosen();
  const body = document.createElement("tbody");
  for (const row of found.slice(0, state.shown)) {
    const tr = document.createElement("tr");
    tr.append(...row.map((value, i) => cell(value, columns[i])));
    body.append(tr);
  }
  table.tBodies[0].replaceWith(body);
  const shown = Math.min(state.shown, found.length);
  count.textContent = `${shown.toLocaleString("en")} of ${found.length.toLocaleString("en")} rows shown`;
  more.hidden = shown === found.length;
}

table.querySelectorAll("thead th").forEach((head, i) => {
  head.querySelector("button").addEventListener("click", () => {
    state.descending = state.column === i ? !state.descending : columns[i].digits !== null;
    state.column = i;
    state.shown = PAGE;
    table.querySelectorAll("thead th").forEach((other) => other.removeAttribute("aria-sort"));
    head.setAttribute("aria-sort", state.descending ? "descending" : "ascending");
    draw();
  });
});
for (const control of [filter, method]) {
  control.addEventListener("input", () => {
    state.shown = PAGE;
    draw();
  });
}
more.addEventListener("click", () => {
  state.shown += 10 * PAGE;
  draw();
});
draw();
