// What the page does by itself: join selections, preview candidates, step through the history, pass on what is
// clicked. It draws from tables that Python has filled, so that a saved page does the same without a server.
window.study = (() => {
  const model = (name) => Bokeh.documents[0].get_model_by_name(name)
  const column = (name, key) => model(name).get_column(key)
  const put = (name, data) => { model(name).data = data }
  const place = (id) => document.getElementById(id)

  // ---- words and axes of the present stage
  const framed = {}
  function words() {
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
    far = null
    clear()
    kept = null
    pins = []
    preview(null)
  }

  // ---- what one candidate would leave, or two: one that is pinned beside the one that is pointed at, or two pinned
  let kept = null, pins = []
  function preview(i) {
    const [first, second] = pins
    const shown = second ?? i ?? first ?? null, beside = first !== undefined && first !== shown ? first : null
    drawn("ghost", "candidate", shown)
    drawn("pinned", "pinned", beside)
    const has = known(shown)
    if (has && kept === null) kept = column("plane", "mean")
    if (kept !== null) {
      const mean = has ? column("would_plane", String(shown)) : kept
      put("plane", {...model("plane").data, mean, below: Float32Array.from(mean, (m) => (m < -1e-6 * model("mapper").high ? 5 : 0))})
      if (!has) kept = null
    }
    constancy(has ? shown : 0, beside)
  }

  const known = (i) => i !== null && model("would_time").get_column(String(i)) !== null
  function drawn(kind, label, i) {
    const has = known(i)
    const line = (name, x, y) => {
      if (has) put(`${kind}_${name}`, {[x]: column(name, x), y: column(y, String(i))})
      else empty(`${kind}_${name}`, {[x]: [], y: []})
    }
    line("time", "t", "would_time")
    line("spectrum", "f", "would_spectrum")
    for (const of of ["u", "v"]) {
      const [at, y] = has ? [column(`would_${of}`, `at${i}`), column(`would_${of}`, `y${i}`)] : [[], []]
      put(`${kind}_${of}`, {at, y})
    }
    for (const name of ["difference", "spectrum", "against_u", "against_v"]) entry(name, label, has)
  }
  const title = (i) => document.querySelector(`[data-candidate="${i}"] .name b`)?.textContent ?? "candidate"

  // a click on a candidate pins it, another one lets it go; of three the first goes
  function pin(i) {
    pins = pins.includes(i) ? pins.filter((other) => other !== i) : [...pins, i].slice(-2)
    for (const row of document.querySelectorAll("[data-candidate]")) {
      row.classList.toggle("pinned", pins.includes(Number(row.dataset.candidate)))
      row.classList.toggle("second", pins[1] === Number(row.dataset.candidate))
    }
    preview(hovered)
  }

  const entry = (name, label, on) => { const item = model(`panel_${name}_${label}`); if (item) item.visible = on }

  const LITTLE = "It explains too little for its coefficient to be followed along frequency."
  const NOBODY = "No candidate explains any of what is left: there is no coefficient to follow along frequency."
  const asked = () => document.querySelector("#verdict h3") !== null

  function constancy(i, beside) {
    const element = document.querySelector(`[data-candidate="${i}"]`)
    const rows = element ? column("constancy", "row") : [], shown = {f: [], value: [], low: [], high: []}
    for (let k = 0; k < rows.length; k++)
      if (rows[k] === i) for (const key in shown) shown[key].push(column("constancy", key)[k])
    const none = [NaN, NaN]  // two points without a value: an axis needs some
    put("shown", shown.f.length ? {...shown, zero: shown.f.map(() => 0)} : {f: [0, 1], value: none, low: none, high: none, zero: [0, 0]})
    if (element) model("constancy_y").axis_label = element.dataset.label
    const heading = place("constancy-of")
    if (heading) heading.textContent = element ? `${title(i)}, 95 % intervals` : ""
    const card = place("constancy-card"), empty = place("constancy-none"), detail = place("detail")
    if (card) card.classList.toggle("none", !shown.f.length)
    if (empty) empty.hidden = shown.f.length > 0 || !asked()
    if (empty) empty.textContent = element ? LITTLE : NOBODY
    const said = (row) => document.querySelector(`[data-candidate="${row}"] small`)?.innerHTML ?? ""
    if (detail) detail.innerHTML = beside === null ? said(i) : `<div class="two"><p>${said(beside)}</p><p>${said(i)}</p></div>`
    for (const row of document.querySelectorAll("[data-candidate]")) row.classList.toggle("shown", row === element)
  }

  // ---- selections: whatever is selected weighs the blocks of time, and these weigh everything else
  const KINDS = {
    time: ["box_response", "box_difference"], band: ["box_force", "box_coherence", "box_spectrum"],
    u: ["box_against_u"], v: ["box_against_v"],
  }

  function weights(kind, from, to) {
    const left = column("blocks", "left"), right = column("blocks", "right"), w = new Float64Array(left.length)
    const inside = (a, b) => Math.max(0, Math.min(b, to) - Math.max(a, from)) / (b - a)
    for (let b = 0; b < w.length; b++) {
      if (kind === "time") { w[b] = inside(left[b], right[b]); continue }
      if (kind === "band") {
        const f = column("lines", "f"), p = column("lines", `p${b}`)
        for (let i = 0; i < f.length; i++) if (f[i] >= from && f[i] <= to) w[b] += p[i]
        continue
      }
      const low = column(`classes_${kind}`, "left"), high = column(`classes_${kind}`, "right")
      const n = column(`classes_${kind}`, `n${b}`)
      let all = 0
      for (let i = 0; i < n.length; i++) { w[b] += n[i] * inside(low[i], high[i]); all += n[i] }
      w[b] = all > 0 ? w[b] / all : 0
    }
    const most = Math.max(...w)
    return most > 0 ? w.map((x) => x / most) : w
  }

  function sums(name, prefix, w) {
    const total = new Float64Array(column(name, `${prefix}0`).length)
    for (let b = 0; b < w.length; b++) {
      const row = column(name, prefix + b)
      for (let i = 0; i < total.length; i++) total[i] += w[b] * row[i]
    }
    return total
  }

  function curve(kind, w) {
    const low = column(`classes_${kind}`, "left"), high = column(`classes_${kind}`, "right")
    const n = sums(`classes_${kind}`, "n", w), s = sums(`classes_${kind}`, "s", w), data = {at: [], y: []}
    for (let i = 0; i < n.length; i++)
      if (n[i] >= 8) { data.at.push(0.5 * (low[i] + high[i])); data.y.push(s[i] / n[i]) }
    return data
  }

  function cells(kind, from, to, w) {
    const seen = column("plane", "seen"), middle = kind === "u" || kind === "v" ? column("plane", `middle_${kind}`) : null
    const mine = sums("cells", "n", w), all = sums("cells", "n", w.map(() => 1))
    const usual = w.reduce((a, b) => a + b, 0) / w.length
    return Float32Array.from(seen, (s, i) => {
      if (!s) return 0
      if (middle) return middle[i] >= from && middle[i] <= to ? 1 : 0
      return kind === "time" ? (mine[i] >= 1 ? 1 : 0) : (mine[i] > 1.1 * usual * all[i] ? 1 : 0)
    })
  }

  function selected(kind, from, to) {
    clear()
    for (const name of KINDS[kind]) { const box = model(name); box.left = from; box.right = to; box.visible = true }
    const w = weights(kind, from, to), total = w.reduce((a, b) => a + b, 0)
    if (!(total > 0)) return
    if (kind !== "time") put("blocks", {...model("blocks").data, weight: Float32Array.from(w, (x) => 0.65 * x)})
    if (kind !== "band")
      put("picked_spectrum", {f: column("lines", "f"), y: sums("lines", "p", w).map((x) => Math.sqrt(x / total))})
    for (const other of ["u", "v"]) if (other !== kind) put(`picked_${other}`, curve(other, w))
    put("plane", {...model("plane").data, picked: cells(kind, from, to, w)})
    for (const name of ["spectrum", "against_u", "against_v"])
      entry(name, "selected", model(`picked_${name.split("_")[1] ?? name}`).get_length() > 0)
    if (kind === "time") near(from, to)
    tell(kind, from, to)
  }

  // the close-up moves to a stretch that was selected
  let far = null
  function near(from, to) {
    const t = column("time", "t"), first = t.findIndex((x) => x >= from), last = t.findLastIndex((x) => x <= to)
    if (last - first < 2) return
    far ??= model("close").data
    const cut = (key) => column("time", key).slice(first, last + 1)
    put("close", {t: cut("t"), measured: cut("measured"), predicted: cut("predicted")})
  }

  function tell(kind, from, to) {
    const axis = {time: "difference_x", band: "force_x", u: "against_u_x", v: "against_v_x"}[kind]
    const [quantity, unit] = model(axis).axis_label.split(" / ")
    const element = place("selection")
    if (!element) return
    element.textContent = `Selected: ${quantity} from ${Number(from.toPrecision(3))} to ${Number(to.toPrecision(3))} ${unit}; ` +
      "all panels show what belongs to it. Escape clears."
    element.classList.add("on")
  }

  // what is drawn anew takes time: only what changes is
  const any = (source, key) => source.get_column(key).some((x) => x !== 0)
  const empty = (name, columns) => { if (model(name).get_length() > 0) put(name, columns) }

  function clear() {
    for (const names of Object.values(KINDS)) for (const name of names) model(name).visible = false
    const blocks = model("blocks"), plane = model("plane")
    if (any(blocks, "weight")) put("blocks", {...blocks.data, weight: new Float32Array(blocks.get_length() ?? 0)})
    if (any(plane, "picked")) put("plane", {...plane.data, picked: new Float32Array(plane.get_length() ?? 0)})
    empty("picked_spectrum", {f: [], y: []})
    for (const kind of ["u", "v"]) empty(`picked_${kind}`, {at: [], y: []})
    for (const name of ["spectrum", "against_u", "against_v"]) entry(name, "selected", false)
    if (far !== null) put("close", far)
    far = null
    const element = place("selection")
    if (element) { element.textContent = element.dataset.hint; element.classList.remove("on") }
  }

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
  let hovered = null
  document.addEventListener("click", (event) => {
    const element = under(event, "act"), row = under(event, "candidate")
    if (row && !element) pin(Number(row.dataset.candidate))
    if (element && !element.disabled)
      act(element.dataset.act, element.dataset.act === "try" ? place("formula").value : element.dataset.name ?? "")
  })
  document.addEventListener("mouseover", (event) => {
    const element = under(event, "candidate"), next = element ? Number(element.dataset.candidate) : null
    if (next !== hovered && place("candidates") && window.study.ready) preview((hovered = next))
  })
  document.addEventListener("focusin", (event) => {
    const element = under(event, "candidate")
    if (element) preview((hovered = Number(element.dataset.candidate)))
  })
  document.addEventListener("keydown", (event) => {
    if (event.key === "Escape" && model("blocks")) { clear(); hovered = null; for (const i of pins) pin(i); preview(null) }
    if ((event.key === "Enter" || event.key === " ") && event.target.dataset?.candidate !== undefined) {
      event.preventDefault()
      pin(Number(event.target.dataset.candidate))
    }
    if (event.key === "Enter" && event.target.id === "formula") act("try", event.target.value)
  })

  const begin = () => {
    window.study.words()
    if (model("state")) { state(); put("asked", {act: ["hello"], name: [""], count: [++count]}) }
    buttons()
    for (const shown of document.querySelectorAll("[data-panel]")) untabbed(shown)
    setTimeout(() => { for (const shown of document.querySelectorAll("[data-panel]")) untabbed(shown) }, 1500)
    window.study.ready = true
  }
  return {
    words, state, selected, clear, step, begin, model, column, put, place, asked, DRAWN, LITTLE, NOBODY, ready: false,
  }
})()
