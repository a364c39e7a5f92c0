"use strict";
const element = (kind, properties, ...children) => {
  const made = Object.assign(document.createElement(kind), properties);
  made.append(...children);
  return made;
};

(() => {
  const value = (body, column) => {
    const cell = body.rows[0].cells[column];
    if (column === 0) return cell.textContent.trim();
    return cell.dataset.sort === undefined ? (/[\p{L}\d]/u.test(cell.textContent) ? cell.textContent.trim() : null) : Number(cell.dataset.sort);
  };

  const compare = (a, b) => {
    if (a === null || b === null) return (a === null) - (b === null);
    return typeof a === "number" && typeof b === "number" ? a - b : String(a).localeCompare(String(b), "en", { numeric: true });
  };

  const sort = (table, column) => {
    const heads = table.tHead.rows[0].cells;
    const descending = heads[column].getAttribute("aria-sort") !== "descending" && column > 0 || heads[column].getAttribute("aria-sort") === "ascending";
    for (const head of heads) head.removeAttribute("aria-sort");
    heads[column].setAttribute("aria-sort", descending ? "descending" : "ascending");
    const bodies = [...table.tBodies].sort((a, b) => {
      const x = value(a, column), y = value(b, column);
      return x === null || y === null || !descending ? compare(x, y) : compare(y, x);
    });
    table.append(...bodies);
  };

  const quoted = (text) => (/[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);

  const label = (cell) => {
    const copy = cell.cloneNode(true);
    copy.querySelectorAll("small, .mark, .copy").forEach((part) => part.remove());
    return copy.textContent.trim();
  };

  const csv = (table) =>
    [...table.rows]
      .filter((row) => !row.closest(".off"))
      .map((row) => [...row.cells].map((cell) => quoted(cell.dataset.sort ?? label(cell))).join(","))
      .join("\n") + "\n";

  const download = (table, name) => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([csv(table)], { type: "text/csv" }));
    link.download = `${name}.csv`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  };

  // What stands behind a number is its tooltip; a touch screen has none, so a tap shows it above the table.
  const tell = (tip, table, cell) => {
    if (!cell) return;
    table.querySelectorAll(".told").forEach((other) => other.classList.remove("told"));
    cell.classList.add("told");
    tip.value = cell.title;
  };

  for (const holder of document.querySelectorAll("[data-table]")) {
    const table = holder.querySelector("table"), name = holder.dataset.table;
    [...table.tHead.rows[0].cells].forEach((head, column) => {
      head.prepend(element("button", { type: "button", onclick: () => sort(table, column) }, head.firstChild));
    });
    const tools = element("div", { className: "tools" });
    const tip = element("output", { className: "tip" });
    tools.append(tip);
    table.addEventListener("click", (event) => tell(tip, table, event.target.closest("td[title]")));
    const save = element("button", { type: "button", onclick: () => download(table, name) }, "CSV");
    save.setAttribute("aria-label", `Download CSV: ${table.caption.textContent}`);
    tools.append(save);
    holder.prepend(tools);
  }

  for (const cell of document.querySelectorAll("td.command")) {
    const copy = element("button", { type: "button", className: "copy" }, "Copy");
    copy.setAttribute("aria-label", `Copy: ${cell.textContent}`);
    copy.onclick = async () => {
      getSelection().selectAllChildren(cell.querySelector("code"));
      try { await navigator.clipboard.writeText(cell.querySelector("code").textContent); }
      catch { return; } // the command is selected, so that it can be copied by hand
      copy.textContent = "Copied";
      setTimeout(() => { copy.textContent = "Copy"; }, 1500);
    };
    cell.append(copy);
  }

  // What scrolls sideways says so, and is reached by keyboard, too.
  const drawings = [...document.querySelectorAll(".canvas > svg")];
  const sized = new ResizeObserver((entries) => {
    for (const place of new Set(entries.map((entry) => entry.target.closest(".canvas, .scroll")))) {
      const wide = place.scrollWidth > place.clientWidth, drawing = place.querySelector(":scope > svg");
      place.parentElement.classList.toggle("wide", wide);
      if (wide && drawing) Object.assign(place, { tabIndex: 0, role: "region", ariaLabel: `Figure ${drawings.indexOf(drawing) + 1}: ${drawing.getAttribute("aria-label")}` });
      else if (drawing) for (const name of ["tabindex", "role", "aria-label"]) place.removeAttribute(name);
    }
  });
  for (const place of document.querySelectorAll(".canvas, .scroll")) sized.observe(place);

  // A link to what is folded unfolds it.
  const unfold = () => {
    const [id] = location.hash.slice(1).split("&");
    for (let part = document.getElementById(id); part; part = part.parentElement) if (part.tagName === "DETAILS") part.open = true;
  };
  window.addEventListener("hashchange", unfold);
  unfold();

  const links = new Map([...document.querySelectorAll("nav a")].map((link) => [link.hash.slice(1), link]));
  const seen = new IntersectionObserver((entries) => {
    for (const entry of entries.filter((each) => each.isIntersecting)) {
      links.forEach((link) => link.removeAttribute("aria-current"));
      links.get(entry.target.id)?.setAttribute("aria-current", "true");
    }
  }, { rootMargin: "-15% 0px -75% 0px" });
  document.querySelectorAll("main > section").forEach((section) => seen.observe(section));

  window.addEventListener("beforeprint", () => document.querySelectorAll("details:not(.chooser)").forEach((part) => { part.open = true; }));
})();
