// The sphere editor's page.
import "../styles/theme.css";
import "../styles/layout.css";
import "../styles/panel.css";
import "../styles/spheres.css";
import { EditorApp } from "./editor_app";

const app = new EditorApp();
app.start();
