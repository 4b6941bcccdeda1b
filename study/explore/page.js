// What every page does by itself: step through the history, follow a candidate, export, pass on what is clicked. It
// draws from tables that Python has filled, so that a saved page does the same without a server. A layer on it adds what
// belongs to one coordinate, or to a structure, and says in `words` what is to be done when another model is shown.
window.study = (() => {
  const model = (name) => Bokeh.documents[0].get_model_by_name(name)
  const column = (name, key) => model(name).get_column(key)
  const put = (name, data) => { model(name).data = data }
  const place = (id) => document.getElementById(id)

  // ---- words and axes of the present stage
  const framed = {}
  function stage() {
    const source = model("words"), places = source.get_column("place"), html = source.get_column("html")
    for (let i = 0; i < places.length; i++) {
      const element = place(places[i])
      if (element) element.innerHTML = html[i]
    }
    const frame = model("frame")
    const [names, properties, values] = ["model", "property", "value"].map((key) => frame.get_column(key))
    for (let i = 0; i < names.length; i++) {
      const target = model(names[i])
      // a zoom in time stays from model to model, and goes where another record has other times
      const key = names[i] + properties[i]
      const before = names[i] === "range_time" ? framed[key] ?? values[i] : target?.[properties[i]]
      framed[key] = values[i]
      if (target && before !== values[i]) target[properties[i]] = values[i]
    }
    catch_up()
  }

  // ---- the coefficient of a candidate along frequency: the rows `keep` of a table that holds all
  const LITTLE = "It explains too little for its coefficient to be followed along frequency."
  const NOBODY = "No candidate explains any of what is left: there is no coefficient to follow along frequency."
  const rows = () => document.querySelectorAll("li.candidate")

  function follow(element, from, keep, title) {
    const none = [NaN, NaN], shown = {f: [0, 1], value: none, low: none, high: none}  // an axis needs two points
    if (keep.length) for (const key in shown) shown[key] = keep.map((k) => column(from, key)[k])
    put("shown", {...shown, zero: shown.f.map(() => 0)})
    if (element) model("constancy_y").axis_label = element.dataset.label
    const heading = place("constancy-of"), empty = place("constancy-none"), detail = place("detail")
    if (heading) heading.textContent = element ? `${title}, 95 % intervals` : ""
    place("constancy-card")?.classList.toggle("none", !keep.length)
    if (empty) empty.hidden = keep.length > 0 || document.querySelector("#verdict h3") === null
    if (empty) empty.textContent = element ? LITTLE : NOBODY
    if (detail) detail.innerHTML = said(element)
    for (const row of rows()) row.classList.toggle("shown", row === element)
  }
  const said = (row) => row?.querySelector("small").innerHTML ?? ""

  // ---- steps and records of a saved page
  let present = null
  const pressed = () => document.querySelector("[data-act=record][aria-pressed=true]")?.dataset.name ?? "0"
  function step(k) { show(k, pressed()) }
  function show(k, record) {
    present = k
    for (const source of Bokeh.documents[0].all_models) {
      const [name, number] = (source.name ?? "").split("@")
      if (number === `${k}.${record}`) model(name).data = source.data
    }
    window.study.words()
    for (const button of document.querySelectorAll("[data-act=step]"))
      button.classList.toggle("now", button.dataset.name === String(k))
  }
  const last = () => Math.max(0, document.querySelectorAll("[data-act=step]").length - 1)

  // ---- axes of frequency, linear or logarithmic
  function logarithm(button) {
    const on = button.getAttribute("aria-pressed") !== "true", range = model("range_frequency")
    button.setAttribute("aria-pressed", String(on))
    range.start = on ? range.tags[0] : 0
    for (const {dataset: {panel}} of document.querySelectorAll("[data-panel]")) {
      const figure = model(`panel_${panel}`)
      if (figure.x_range !== range) continue
      figure.x_scale = new (Bokeh.Models.get(on ? "LogScale" : "LinearScale"))()
      model(`${panel}_x`).ticker = on ? model("frequency_decades") : model("frequency_even")
    }
  }

  // ---- the numbers of a panel as a file
  const DRAWN = {
    history: ["history"], response: ["time"], close: ["close"], force: ["force"], coherence: ["coherence"],
    spectrum: ["spectrum"], plane: ["plane"], against_u: ["against_u"], against_v: ["against_v"], frf: ["frf"],
    phase: ["frf"], linearity: ["frf"], loop_u: ["loops"], loop_v: ["loops"], cycles: ["cycles"],
    decay_frequency: ["decay", "decay_model"], decay_damping: ["decay", "decay_model"],
    autocorrelation: ["autocorrelation"], with_force: ["with_force"], histogram: ["histogram"], constancy: ["shown"],
  }

  function table(name) {
    const data = model(name).data, keys = Object.keys(data), rows = []
    const cells = (value) => value != null && typeof value !== "string" && value.length !== undefined ? Array.from(value).join(" ") : value
    for (let i = 0; i < model(name).get_length(); i++) rows.push(keys.map((key) => `"${String(cells(data[key][i])).replace(/"/g, '""')}"`.replace(/^"(-?[0-9.e+-]+)"$/, "$1")))
    return [keys, ...rows].map((row) => row.join(",")).join("\n") + "\n"
  }

  function exported(panel) {
    const units = [`${panel}_x`, `${panel}_y`].map((name) => model(name)?.axis_label).filter(Boolean).join("; ")
    const link = document.createElement("a")
    link.href = URL.createObjectURL(new Blob([`# ${units}\n`, ...DRAWN[panel].map(table)], {type: "text/csv"}))
    link.download = `${document.title.replace(/[^\w]+/g, "_")}_${panel}.csv`
    link.click()
    setTimeout(() => URL.revokeObjectURL(link.href), 1000)
  }

  function buttons() {
    for (const shown of document.querySelectorAll("[data-panel]")) {
      const panel = shown.dataset.panel, near = [shown.closest(".panel"), shown.closest(".card")]
      const heading = near.map((place) => place?.querySelector(":scope > h2")).find(Boolean)
      if (!heading || heading.querySelector(`[data-name=${panel}]`) || !DRAWN[panel]) continue
      const button = document.createElement("button"), label = heading.querySelector(".csv") ? "CSV of the close-up" : "CSV"
      Object.assign(button, {className: "csv", textContent: label, title: "the numbers of this panel as a file"})
      Object.assign(button.dataset, {act: "csv", name: panel})
      if (!heading.querySelector(".csvs")) heading.append(Object.assign(document.createElement("span"), {className: "csvs"}))
      heading.querySelector(".csvs").append(button)
    }
  }

  // ---- panels are drawn one by one: first those in view, then, while nothing else is done, whichever is next to it
  const waiting = () => [...document.querySelectorAll("[data-panel]:not(.drawn)")]
  const next = () => new Promise((done) => requestIdleCallback(done, {timeout: 1000}))

  function beyond(shown) {
    const box = shown.getBoundingClientRect()
    return Math.max(0, box.top - innerHeight, -box.bottom)  // pixels from the view
  }

  // ---- what is out of view is painted anew when it comes near it, or after what is in view
  const views = new Map(), resting = new Set(), NEAR = 200, SETTLED = 1500  // pixels; milliseconds
  function rest(shown, on) {
    if (on === resting.has(shown)) return
    resting[on ? "add" : "delete"](shown)
    if (on) views.get(shown).pause()
    else views.get(shown).unpause()
  }
  const watched = new IntersectionObserver(
    (all) => { for (const {target, isIntersecting} of all) rest(target, !isIntersecting) }, {rootMargin: `${NEAR}px`})
  const frame = () => new Promise(requestAnimationFrame)

  let turn = 0
  async function catch_up() {
    const mine = ++turn
    for (const shown of [...resting]) {
      await next()
      rest(shown, false)
      await frame()
      await frame()
      rest(shown, beyond(shown) > NEAR)
      if (mine !== turn) return
    }
  }
  addEventListener("beforeprint", () => { for (const shown of [...resting]) rest(shown, false) })

  async function draw(shown) {
    shown.classList.add("drawn")
    const view = await Bokeh.documents[0].views_manager.build_view(model(`panel_${shown.dataset.panel}`))
    view.build(shown)
    shown.style.height = ""
    untabbed(shown)  // and its tools, which come later
    views.set(shown, view)
    setTimeout(() => { untabbed(shown); watched.observe(shown) }, SETTLED)
  }

  async function draw_rest() {
    for (let left = waiting(); left.length; left = waiting()) {
      await next()
      await draw(left.reduce((a, b) => (beyond(b) < beyond(a) ? b : a)))
    }
    window.study.drawn = true
  }

  // Tools of the panels are for the mouse: the Tab key goes from one action to the next.
  function untabbed(root) {
    for (const element of root.querySelectorAll("*")) {
      if (element.tabIndex >= 0) element.tabIndex = -1
      if (element.shadowRoot) untabbed(element.shadowRoot)
    }
  }

  // ---- what is clicked goes to Python
  let count = 0
  function act(action, name) {
    if (action === "step") return step(Number(name))
    if (action === "record" && !model("asked")) return show(present ?? last(), name)
    if (action === "csv") return exported(name)
    if (action === "logarithm") return logarithm(document.querySelector("[data-act=logarithm]"))
    if (action === "save") name = place("with-values").checked ? "values" : "open"
    if (document.body.classList.contains("busy") && action !== "try") return
    put("asked", {act: [action], name: [String(name)], count: [++count]})
  }

  function state() {
    const shown = (key) => column("state", key)[0]
    document.body.classList.toggle("busy", shown("busy") !== "")
    for (const [id, key] of [["busy", "doing"], ["answer", "answer"], ["notice", "notice"]]) {
      const element = place(id)
      if (element) element.textContent = shown(key)
    }
    document.body.classList.toggle("working", shown("doing") !== "")
    const undo = document.querySelector("[data-act=undo]")
    if (undo) undo.disabled = !shown("undo")
    const field = place("formula")
    if (field) {
      field.setAttribute("aria-invalid", shown("answer") !== "" ? "true" : "false")
      if (shown("accepted") && field.value === shown("accepted")) field.value = ""
    }
  }

  const under = (event, key) => event.composedPath().find((e) => e.dataset && e.dataset[key] !== undefined)
  document.addEventListener("click", (event) => {
    const element = window.study.ready && under(event, "act")  // words are there before what draws them anew
    if (element && !element.disabled)
      act(element.dataset.act, element.dataset.act === "try" ? place("formula").value : element.dataset.name ?? "")
  })
  document.addEventListener("keydown", (event) => {
    if (event.key === "Enter" && event.target.id === "formula") act("try", event.target.value)
  })

  const begin = async () => {
    window.study.words()
    if (model("state")) { state(); put("asked", {act: ["hello"], name: [""], count: [++count]}) }
    buttons()
    for (const shown of waiting()) if (beyond(shown) === 0) await draw(shown)
    window.study.ready = true
    await draw_rest()
  }
  return {stage, step, begin, state, follow, said, under, model, column, put, place, DRAWN, ready: false, drawn: false}
})()
