// Puts the page together: what comes in, which moment is shown, and what shows it.
import "uplot/dist/uPlot.min.css";
import "./styles/theme.css";
import "./styles/layout.css";
import "./styles/panel.css";
import "./styles/dock.css";
import { App } from "./app";

const app = new App();
app.start();
