//! Where on the screen a place of the view is.

use super::browser::Browser;
use super::robot::Robot;

/// From places of odom to the screen, however the page is scrolled and the view was dragged; nobody zoomed.
pub struct Screen {
    scale: f64,
}

impl Screen {
    pub fn of(page: &mut Browser, robot: &Robot) -> Screen {
        let footprint = robot.read("robot")["footprint"].clone();
        let corners = footprint.as_array().unwrap().iter();
        let reach_m = corners.fold(0.2, |reach: f64, corner| {
            reach.max(corner[0].as_f64().unwrap().hypot(corner[1].as_f64().unwrap()))
        });
        let size =
            "(({ clientWidth: w, clientHeight: h }) => Math.min(w, h))(document.getElementById('view'))";
        let side = page.value(size).as_f64().unwrap();
        Screen { scale: side / (8.0 * reach_m) }
    }

    /// Where a place of odom is now, pixels.
    pub fn place(&self, page: &mut Browser, [x_m, y_m]: [f64; 2]) -> [f64; 2] {
        let middle = page.middle("#view");
        let centre_m = page.value("document.getElementById('view').dataset.centre_m.split(' ').map(Number)");
        let [dx_m, dy_m] = [(0, x_m), (1, y_m)].map(|(axis, at_m)| at_m - centre_m[axis].as_f64().unwrap());
        [middle[0] + dx_m * self.scale, middle[1] - dy_m * self.scale]
    }

    pub fn click(&self, page: &mut Browser, at_m: [f64; 2]) {
        let at = self.place(page, at_m);
        page.mouse("mousePressed", at);
        page.mouse("mouseReleased", at);
    }
}
