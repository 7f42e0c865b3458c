"use strict";

// Why a line is not up, step by step, and which PLCs are on a network.

const explore = (() => {
  const get = (id) => document.getElementById(id);
  let change = null;

  function make(kind, properties, ...children) {
    const element = Object.assign(document.createElement(kind), properties);
    element.append(...children);
    return element;
  }

  function stepOf({ name, verdict, evidence, details, next }) {
    const item = make("li", { className: verdict }, make("strong", { textContent: verdict }), ` ${name}: ${evidence}`);
    for (const detail of details) item.append(make("span", { className: "detail", textContent: detail }));
    if (next) item.append(make("span", { className: "next", textContent: `→ ${next}` }));
    return item;
  }

  function deviceOf({ address, bus, identity, facts, hasTable }, index) {
    const text = [address, bus, ...facts, identity || "says nothing about itself"].join(" · ");
    const item = make("li", {}, make("span", { textContent: text }));
    if (hasTable) {
      const use = make("button", { type: "button", textContent: "Use" });
      use.setAttribute("aria-label", `Use ${text}`);
      use.addEventListener("click", () => change("use", String(index)));
      item.append(" ", use);
    }
    return item;
  }

  return {
    begin(given) {
      change = given;
      get("examine").addEventListener("click", () => change("examine"));
      get("find-form").addEventListener("submit", (event) => {
        event.preventDefault();
        change("find", get("targets").value);
      });
      get("cancel").addEventListener("click", () => change("cancel"));
    },
    show({ busy, steps, devices, told }, mayEdit, hasMistakes) {
      get("examine").disabled = !mayEdit || busy !== null || hasMistakes;
      get("find").disabled = !mayEdit || busy !== null;
      get("cancel").hidden = busy === null;
      get("busy").textContent = busy === "examine" ? "going along the line …" : busy === "find" ? "searching …" : "";
      get("steps").replaceChildren(...steps.map(stepOf));
      get("devices").replaceChildren(...devices.map(deviceOf));
      get("found-told").textContent = told;
    },
  };
})();
