"use strict";
(() => {
  // A step without photos of its own, like the prediction, shows those of the step before it: the target's.
  const photos = (steps, at, kind) => {
    for (let i = at; i >= 0; i--) {
      const found = steps[i].querySelector(`${kind} img`);
      if (found) return [found];
    }
    return [];
  };

  // Pictures stay and change their source, since new ones would flicker.
  const fill = (holders, pictures) => holders.forEach((holder, i) => {
    holder.hidden = i >= pictures.length;
    if (!holder.hidden) Object.assign(holder.querySelector("img"), { src: pictures[i].src, alt: pictures[i].alt });
  });

  const flip = (views) => {
    const steps = [...views.querySelectorAll("[data-step]")];
    if (steps.length < 2) return;
    const grids = steps.map((step) => [...step.querySelectorAll(".map.lead img")]);
    const hold = (kind) => {
      const { src, alt } = views.querySelector(`.${kind} img`);
      return element("span", { className: kind }, element("img", { src, alt }));
    };
    const photo = views.querySelector(".photo") ? [hold("photo")] : [];
    const labels = views.querySelector(".labels") ? [hold("labels")] : [];
    const maps = Array.from({ length: Math.max(...grids.map((each) => each.length)) }, () => hold("map"));
    views.querySelector(".photo")?.querySelectorAll(".crop").forEach((crop) => photo[0].append(crop.cloneNode(true)));
    const title = element("output", {}), note = element("small", {});
    const slider = element("input", { type: "range", min: 0, max: steps.length - 1, value: steps.length - 1 });
    slider.setAttribute("aria-label", "Step from the inputs over the target to the prediction");
    const show = () => {
      const at = Number(slider.value), step = steps[at];
      fill(photo, photos(steps, at, ".photo"));
      fill(labels, photos(steps, at, ".labels"));
      fill(maps, grids[at]);
      title.value = step.dataset.step;
      note.textContent = step.querySelector("figcaption small")?.textContent ?? "";
      slider.setAttribute("aria-valuetext", `${title.value} ${note.textContent}`);
    };
    let timer = 0;
    const play = element("button", { type: "button", textContent: "Play" });
    play.onclick = () => {
      if (timer) timer = clearInterval(timer) ?? 0;
      else timer = setInterval(() => { slider.value = (Number(slider.value) + 1) % steps.length; show(); }, 700);
      play.textContent = timer ? "Stop" : "Play";
    };
    slider.oninput = show;
    show();
    const stage = element("div", { className: "stage" }, ...photo, ...labels, element("div", { className: "maps" }, ...maps));
    const controls = element("figcaption", {}, play, slider);
    views.prepend(element("figure", { className: "flip" }, stage, controls, title, note));
  };
  document.querySelectorAll(".views").forEach(flip);
})();
