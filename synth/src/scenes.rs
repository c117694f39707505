//! The scenes that come with the program.

/// A scene file within the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EmbeddedScene {
    /// Name on the command line.
    pub name: &'static str,
    /// Description in one line.
    pub about: &'static str,
    /// The file.
    pub toml: &'static str,
}

/// All of them.
pub const SCENES: [EmbeddedScene; 28] = [
    EmbeddedScene {
        name: "furnished-room",
        about: "a living room with a window and lamps, by day and in the evening",
        toml: include_str!("../scenes/furnished-room.toml"),
    },
    EmbeddedScene {
        name: "small-room",
        about: "a box with a few things in it, for tests: seconds",
        toml: include_str!("../scenes/small-room.toml"),
    },
    EmbeddedScene {
        name: "kitchenette",
        about: "small panels in the ceiling, a strip under a cabinet, a spot; each alone, too",
        toml: include_str!("../scenes/kitchenette.toml"),
    },
    EmbeddedScene {
        name: "bedroom",
        about: "a bare bulb, a shaded lamp and a cool tube; each alone, too",
        toml: include_str!("../scenes/bedroom.toml"),
    },
    EmbeddedScene {
        name: "office",
        about: "a large panel, a floor lamp and a screen; each alone, too",
        toml: include_str!("../scenes/office.toml"),
    },
    EmbeddedScene {
        name: "living-room",
        about: "small panels in a ceiling, a wide one behind two bulbs, a shaded lamp; each alone, too",
        toml: include_str!("../scenes/living-room.toml"),
    },
    EmbeddedScene {
        name: "shop",
        about: "tubes below a ceiling, a cluster of bulbs, a bar, signs side by side; each alone, too",
        toml: include_str!("../scenes/shop.toml"),
    },
    EmbeddedScene {
        name: "attic",
        about: "a window and a globe before it, spots, a strip of another colour; each alone, too",
        toml: include_str!("../scenes/attic.toml"),
    },
    EmbeddedScene {
        name: "bathroom",
        about: "a bar over a mirror, round lamps, a cube on a cord; each alone, too",
        toml: include_str!("../scenes/bathroom.toml"),
    },
    EmbeddedScene {
        name: "lounge",
        about: "a strip that no view sees, spots, a globe, a screen, a shaded lamp; some alone, too",
        toml: include_str!("../scenes/lounge.toml"),
    },
    EmbeddedScene {
        name: "corridor",
        about: "sconces, a strip at the floor, a tube, a dim sign; some alone, too",
        toml: include_str!("../scenes/corridor.toml"),
    },
    EmbeddedScene {
        name: "dining-room",
        about: "three shades, candles, a strip under a shelf, a window, a globe; each alone, too",
        toml: include_str!("../scenes/dining-room.toml"),
    },
    EmbeddedScene {
        name: "classroom",
        about: "panels, a bar over the board, a projection, two windows; some alone, too",
        toml: include_str!("../scenes/classroom.toml"),
    },
    EmbeddedScene {
        name: "studio",
        about: "a panel, cans, bulbs over a mirror, a neon of two bars; each alone, too",
        toml: include_str!("../scenes/studio.toml"),
    },
    EmbeddedScene {
        name: "loft",
        about: "a window of panes, a frame of bars, a strip at the floor, a tank; each alone, too",
        toml: include_str!("../scenes/loft.toml"),
    },
    EmbeddedScene {
        name: "glossy-room",
        about: "a steel cabinet, a glossy floor and a varnished table, by day and in the evening",
        toml: include_str!("../scenes/glossy-room.toml"),
    },
    EmbeddedScene {
        name: "divided-room",
        about: "a wall down the middle and five lamps, each alone: any of them leaves much in the dark",
        toml: include_str!("../scenes/divided-room.toml"),
    },
    EmbeddedScene {
        name: "hotel-room",
        about: "a strip behind a headboard, wall globes, a tube over a mirror; each alone, too",
        toml: include_str!("../scenes/hotel-room.toml"),
    },
    EmbeddedScene {
        name: "gallery",
        about: "six spots on a rail, tubes end to end below a board, a light box; each alone, too",
        toml: include_str!("../scenes/gallery.toml"),
    },
    EmbeddedScene {
        name: "salon",
        about: "a mirror between bulbs, tiny pendants, a strip of magenta, a screen; each alone, too",
        toml: include_str!("../scenes/salon.toml"),
    },
    EmbeddedScene {
        name: "bistro",
        about: "twelve downlights, a window with sky and street, domes, candles; most alone, too",
        toml: include_str!("../scenes/bistro.toml"),
    },
    EmbeddedScene {
        name: "study",
        about: "a window, and shades and a bowl that no view looks into; each alone, too",
        toml: include_str!("../scenes/study.toml"),
    },
    EmbeddedScene {
        name: "nursery",
        about: "a string of bulbs, half a globe on a wall, three bulbs together, a strip; each alone, too",
        toml: include_str!("../scenes/nursery.toml"),
    },
    EmbeddedScene {
        name: "workshop",
        about: "a wall of glass, a ring, troffers, screens, and light of hidden bulbs; each alone, too",
        toml: include_str!("../scenes/workshop.toml"),
    },
    EmbeddedScene {
        name: "parlour",
        about: "three flames in a hearth, a lantern, a tree of tiny bulbs, two screens; each alone, too",
        toml: include_str!("../scenes/parlour.toml"),
    },
    EmbeddedScene {
        name: "washroom",
        about: "a frame of bars, a mirror between bulbs, strips in a corner, a sconce; each alone, too",
        toml: include_str!("../scenes/washroom.toml"),
    },
    EmbeddedScene {
        name: "hallway",
        about: "a mirror over a console, another on a wardrobe, a pendant, a lamp, spots; each alone, too",
        toml: include_str!("../scenes/hallway.toml"),
    },
    EmbeddedScene {
        name: "canteen",
        about: "two bulbs in closed shades, one in a shade that is open above, a window; each alone, too",
        toml: include_str!("../scenes/canteen.toml"),
    },
];

/// The scene of this name.
pub fn embedded(name: &str) -> Option<EmbeddedScene> {
    SCENES.into_iter().find(|scene| scene.name == name)
}
