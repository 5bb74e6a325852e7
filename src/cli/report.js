
"use strict";
for (const note of document.querySelectorAll(".js")) note.style.display = "inline";
for (const table of document.querySelectorAll("table.sortable")) {
  const heads = [...table.tHead.rows[0].cells];
  heads.forEach((head, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => {
      const up = head.getAttribute("aria-sort") !== "ascending";
      for (const other of heads) other.removeAttribute("aria-sort");
      head.setAttribute("aria-sort", up ? "ascending" : "descending");
      const value = (row) => row.cells[column].dataset.v;
      const number = (row) => { const v = value(row); return v === "inf" ? Infinity : Number(v); };
      const order = (a, b) => {
        if (value(a) === undefined) return a.cells[column].textContent.localeCompare(b.cells[column].textContent);
        const [x, y] = [number(a), number(b)];
        return x < y ? -1 : x > y ? 1 : 0;
      };
      const body = table.tBodies[0];
      const rows = [...body.rows].sort((a, b) => (up ? order(a, b) : order(b, a)));
      body.append(...rows);
    });
  });
}
