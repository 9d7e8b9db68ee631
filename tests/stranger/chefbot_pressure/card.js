// The card: the last rise of the pressure, and a button that counts from zero again.

export default class PressureCard {
  constructor({ connection, ask, section }) {
    this.section = section;
    this.told = document.createElement("p");
    this.button = Object.assign(document.createElement("button"), { type: "button", textContent: "Count from zero" });
    section.append(Object.assign(document.createElement("h2"), { textContent: "Pressure" }), this.told, this.button);
    connection.on("pressure", ({ pressure_hpa, rises }) => {
      this.told.textContent = `${pressure_hpa.toFixed(1)} hPa, ${rises} rises`;
      section.hidden = false;
    });
    this.button.addEventListener("click", async () => {
      if (await ask("reset_pressure")) this.told.textContent = "counting from zero";
    });
  }

  begin(can) {
    this.button.hidden = !can.has("method.reset_pressure");
  }
}
