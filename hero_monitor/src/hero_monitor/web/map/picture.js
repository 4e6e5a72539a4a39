// The camera's picture: each that the monitor announces is fetched while it is shown, one at a time.

const HINT = "no picture: roslaunch hero_localization camera.launch";

const element = (id) => document.getElementById(id);

export class CameraPicture {
  /** redraw: is called when the map has another picture, or none. */
  constructor(redraw) {
    this.redraw = redraw;
    this.box = null; // of the picture on the map, mm; null: it is shown in a panel, or not at all
    this.poses = {}; // of robots when it was taken
    this.image = null;
    this.wanted = null; // as the monitor describes it: number, box on the map, poses
    this.number = null;
    this.fetching = false;
  }

  /** Show the picture that the monitor describes (null: it has none), or no picture. */
  show(isShown, picture) {
    this.isShown = isShown;
    this.wanted = isShown ? picture : null;
    if (this.wanted === null) {
      this.image = this.box = this.number = null;
      this.place();
    } else this.fetch();
  }

  fetch() {
    if (this.fetching || this.wanted === null || this.wanted.number === this.number) return;
    this.fetching = true;
    const { number, box, poses } = this.wanted;
    const image = new Image();
    const end = () => {
      this.fetching = false;
      this.number = number;
      this.fetch();
    };
    image.addEventListener("error", end);
    image.addEventListener("load", () => {
      if (this.wanted !== null) {
        [this.image, this.box, this.poses] = [image, box, poses];
        this.place();
      }
      end();
    });
    image.src = `picture/${number}`;
  }

  /** Put a picture without a place on the map into the panel. */
  place() {
    const beside = this.isShown && this.box === null ? [this.image || HINT] : [];
    element("panel").hidden = beside.length === 0;
    element("panel").replaceChildren(...beside);
    this.redraw();
  }
}
