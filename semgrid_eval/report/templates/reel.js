"use strict";
(() => {
  const STEP_MS = 450;
  const still = matchMedia("(prefers-reduced-motion: reduce)");

  const set_up = (reel) => {
    const moments = JSON.parse(reel.dataset.moments), last = moments.length - 1;
    if (last < 1) return;
    const slider = element("input", { type: "range", min: 0, max: last, value: last });
    slider.setAttribute("aria-label", "Moment");
    const play = element("button", { type: "button" }), said = element("output", {});
    let timer = 0;
    const show = () => {
      reel.style.setProperty("--at", `${(100 * slider.value) / last}%`);
      said.value = moments[slider.value];
      slider.setAttribute("aria-valuetext", said.value);
    };
    const stop = () => { clearInterval(timer); timer = 0; play.textContent = "Play"; };
    // What somebody starts goes on until it is stopped; what starts by itself shows each moment once.
    const start = (once) => {
      slider.value = once || Number(slider.value) === last ? 0 : slider.value;
      show();
      timer = setInterval(() => {
        slider.value = Number(slider.value) === last ? 0 : Number(slider.value) + 1;
        show();
        if (once && Number(slider.value) === last) stop();
      }, STEP_MS);
      play.textContent = "Stop";
    };
    play.onclick = () => (timer ? stop() : start(false));
    slider.oninput = () => { stop(); show(); };
    reel.querySelector("figcaption").replaceChildren(play, slider, said);
    stop();
    show();
    const seen = new IntersectionObserver(([entry]) => {
      if (!entry.isIntersecting) return;
      seen.disconnect();
      if (!still.matches && !timer) start(true);
    }, { threshold: 0.6 });
    seen.observe(reel);
    still.addEventListener("change", () => { if (still.matches) stop(); });
    window.addEventListener("beforeprint", () => { stop(); slider.value = last; show(); });
  };
  document.querySelectorAll(".reel").forEach(set_up);
})();
