"use strict";
(() => {
  const chooser = document.querySelector(".chooser");
  if (!chooser) return;
  const form = chooser.querySelector("form"), find = form.elements.names, said = chooser.querySelector("output");
  const sets = [...form.querySelectorAll("fieldset")];
  const boxes = (set) => [...set.querySelectorAll("input")];
  const names = Object.entries(JSON.parse(chooser.dataset.names));
  const marked = [...document.querySelectorAll("[data-row]")].map((part) => [part, part.dataset.row.split(" ")]);
  // What holds nothing but parts of rows that are left out is left out, too.
  const holders = [...document.querySelectorAll("main .table, main .plot, main details")]
    .map((holder) => [holder, holder.querySelectorAll("[data-row]")])
    .filter(([, parts]) => parts.length);

  const left = () => {
    const off = new Set();
    for (const set of sets) {
      const on = new Set(boxes(set).flatMap((box) => (box.checked ? box.dataset.rows.split(" ") : [])));
      for (const box of boxes(set)) for (const row of box.dataset.rows.split(" ")) if (!on.has(row)) off.add(row);
    }
    const wanted = find.value.toLowerCase().split(",").map((word) => word.trim()).filter(Boolean);
    if (wanted.length)
      for (const [row, name] of names) if (!wanted.some((word) => name.toLowerCase().includes(word))) off.add(row);
    return off;
  };

  const apply = () => {
    const off = left();
    for (const [part, rows] of marked) part.classList.toggle("off", rows.every((row) => off.has(row)));
    for (const [holder, parts] of holders)
      if (!holder.dataset.row) holder.classList.toggle("off", [...parts].every((part) => part.classList.contains("off")));
    said.value = off.size ? `${names.length - off.size} of ${names.length}` : "all";
    chooser.classList.toggle("chosen", off.size > 0);
  };

  // The address is #SECTION&families=ED&names=DC: a part names what is shown, and all is shown where it is missing.
  const address = () => {
    const [section, ...rest] = location.hash.slice(1).split("&");
    return [section, new URLSearchParams(rest.join("&"))];
  };

  const write = () => {
    const chosen = new URLSearchParams();
    for (const set of sets)
      if (boxes(set).some((box) => !box.checked))
        for (const box of boxes(set).filter((each) => each.checked)) chosen.append(set.name, box.value);
    if (find.value) chosen.set("names", find.value);
    const [section] = address();
    history.replaceState(null, "", `#${section}${chosen.size ? `&${chosen}` : ""}`);
  };

  const read = () => {
    const [section, chosen] = address();
    for (const set of sets) {
      const shown = chosen.getAll(set.name);
      for (const box of boxes(set)) box.checked = !shown.length || shown.includes(box.value);
    }
    find.value = chosen.get("names") ?? "";
    apply();
    if (chosen.size) document.getElementById(section)?.scrollIntoView();
  };

  form.addEventListener("input", () => { apply(); write(); });
  form.addEventListener("reset", () => setTimeout(() => { apply(); write(); }));
  form.addEventListener("submit", (event) => event.preventDefault());
  window.addEventListener("hashchange", () => (location.hash.includes("&") ? read() : write()));
  document.addEventListener("click", (event) => { if (!chooser.contains(event.target)) chooser.open = false; });
  chooser.addEventListener("keydown", (event) => { if (event.key === "Escape") chooser.open = false; });
  chooser.hidden = false;
  read();
})();
