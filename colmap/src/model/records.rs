//! The records of the five files, field by field; one description for text and binary.

use super::fields::{FieldReader, FieldWriter, Written};
use super::{
    CameraId, FrameId, ImageId, ModelCamera, ModelImage, ModelPoint, Observation, Observations,
    PointId, Rig, RigFrame, RigId, Rigid, SensorId, SensorType, TrackElement,
};
use crate::error::Result;
use eagpt_scene::Lens;
use glam::{DQuat, DVec2, DVec3};

/// Quaternions shorter than this have no direction.
const MIN_QUATERNION: f64 = 1e-6;
/// Quaternions nearer than this to unit length are not normalised: a model that is read and written
/// keeps its bits.
const QUATERNION_TOLERANCE: f64 = 1e-12;
/// Bytes of a pose: a quaternion and a translation.
const POSE_BYTES: u64 = 7 * 8;

impl SensorType {
    /// All kinds with their names in text files.
    pub(super) const ALL: [(Self, &'static str); 3] = [
        (Self::Invalid, "INVALID"),
        (Self::Camera, "CAMERA"),
        (Self::Imu, "IMU"),
    ];
}

/// A record of a file.
pub(super) trait Record: Sized {
    /// Its first field, which no other record may share.
    type Id: Copy + Eq + std::hash::Hash + std::fmt::Display;
    /// Name in error messages.
    const NAME: &'static str;
    /// Comment in text files.
    const HEADER: &'static str;
    /// The fewest bytes it takes.
    const MIN_BYTES: u64;

    fn id(&self) -> Self::Id;
    fn read(reader: &mut impl FieldReader, observations: Observations) -> Result<Self>;
    fn write(&self, writer: &mut impl FieldWriter) -> Written;
}

impl Record for ModelCamera {
    type Id = CameraId;
    const NAME: &'static str = "camera";
    const HEADER: &'static str = "CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]";
    const MIN_BYTES: u64 = 4 + 4 + 8 + 8 + 2 * 8;

    fn id(&self) -> CameraId {
        self.id
    }

    fn read(reader: &mut impl FieldReader, _: Observations) -> Result<Self> {
        let id = CameraId(reader.u32("the number of a camera")?);
        let model = reader.model()?;
        let (width, height) = (reader.u64("the width")?, reader.u64("the height")?);
        let pixels = |n: u64| u32::try_from(n).unwrap_or(u32::MAX);
        let names = model.param_names();
        let params = names
            .iter()
            .map(|name| reader.f64(name))
            .collect::<Result<Vec<_>>>()?;
        let lens = Lens::new(model, (pixels(width), pixels(height)), &params)
            .map_err(|problem| reader.error(format!("camera {id}: {problem}")))?;
        Ok(Self { id, lens })
    }

    fn write(&self, writer: &mut impl FieldWriter) -> Written {
        writer.u32(self.id.0)?;
        writer.model(self.lens.model())?;
        let (width, height) = self.lens.size();
        writer.u64(width.into())?;
        writer.u64(height.into())?;
        for param in self.lens.params() {
            writer.f64(*param)?;
        }
        writer.end_line()
    }
}

impl Record for ModelImage {
    type Id = ImageId;
    const NAME: &'static str = "image";
    const HEADER: &'static str = "IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME; next line: POINTS2D[] as (X, Y, POINT3D_ID)";
    const MIN_BYTES: u64 = 4 + POSE_BYTES + 4 + 1 + 8;

    fn id(&self) -> ImageId {
        self.id
    }

    fn read(reader: &mut impl FieldReader, observations: Observations) -> Result<Self> {
        const FIELDS: usize = 3;
        const BYTES: u64 = 24;
        let id = ImageId(reader.u32("the number of an image")?);
        let camera_from_world = pose(reader)?;
        let camera = CameraId(reader.u32("the camera of an image")?);
        let name = reader.name()?;
        reader.next_line()?;
        let num = reader.list("features", FIELDS, BYTES)?;
        let mut list = Vec::new();
        if observations == Observations::Keep {
            list.reserve_exact(num);
            for _ in 0..num {
                list.push(Observation {
                    at: DVec2::new(reader.f64("x of a feature")?, reader.f64("y of a feature")?),
                    point: reader.point_or_none()?.map(PointId),
                });
            }
        } else {
            reader.skip(num, FIELDS, BYTES)?;
        }
        Ok(Self {
            id,
            camera_from_world,
            camera,
            name,
            observations: list,
        })
    }

    fn write(&self, writer: &mut impl FieldWriter) -> Written {
        writer.u32(self.id.0)?;
        write_pose(writer, &self.camera_from_world)?;
        writer.u32(self.camera.0)?;
        writer.name(&self.name)?;
        writer.end_line()?;
        writer.list(self.observations.len())?;
        for observation in &self.observations {
            writer.f64(observation.at.x)?;
            writer.f64(observation.at.y)?;
            writer.point_or_none(observation.point.map(|id| id.0))?;
        }
        writer.end_line()
    }
}

impl Record for ModelPoint {
    type Id = PointId;
    const NAME: &'static str = "point";
    const HEADER: &'static str =
        "POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)";
    const MIN_BYTES: u64 = 8 + 3 * 8 + 3 + 8 + 8;

    fn id(&self) -> PointId {
        self.id
    }

    fn read(reader: &mut impl FieldReader, observations: Observations) -> Result<Self> {
        const FIELDS: usize = 2;
        const BYTES: u64 = 8;
        let id = PointId(reader.u64("the number of a point")?);
        let position = vector(reader, ["x of a point", "y of a point", "z of a point"])?;
        let color_srgb8 = [reader.u8("red")?, reader.u8("green")?, reader.u8("blue")?];
        let error_px = reader.f64("the error of a point")?;
        let num = reader.list("observations", FIELDS, BYTES)?;
        let mut track = Vec::new();
        if observations == Observations::Keep {
            track.reserve_exact(num);
            for _ in 0..num {
                track.push(TrackElement {
                    image: ImageId(reader.u32("the image of an observation")?),
                    observation: reader.u32("the index of an observation")?,
                });
            }
        } else {
            reader.skip(num, FIELDS, BYTES)?;
        }
        Ok(Self {
            id,
            position,
            color_srgb8,
            error_px,
            track_length: u32::try_from(num).unwrap_or(u32::MAX),
            track,
        })
    }

    fn write(&self, writer: &mut impl FieldWriter) -> Written {
        writer.u64(self.id.0)?;
        for value in self.position.to_array() {
            writer.f64(value)?;
        }
        for value in self.color_srgb8 {
            writer.u8(value)?;
        }
        writer.f64(self.error_px)?;
        writer.list(self.track.len())?;
        for element in &self.track {
            writer.u32(element.image.0)?;
            writer.u32(element.observation)?;
        }
        writer.end_line()
    }
}

impl Record for Rig {
    type Id = RigId;
    const NAME: &'static str = "rig";
    const HEADER: &'static str = "RIG_ID, NUM_SENSORS, REF_SENSOR_TYPE, REF_SENSOR_ID, SENSORS[] as (SENSOR_TYPE, SENSOR_ID, HAS_POSE, [QW, QX, QY, QZ, TX, TY, TZ])";
    const MIN_BYTES: u64 = 4 + 4;

    fn id(&self) -> RigId {
        self.id
    }

    fn read(reader: &mut impl FieldReader, _: Observations) -> Result<Self> {
        let id = RigId(reader.u32("the number of a rig")?);
        let num_sensors = reader.short_list("sensors", 8)?;
        let reference = (num_sensors > 0).then(|| sensor(reader)).transpose()?;
        let mut others = Vec::new();
        for _ in 1..num_sensors {
            let sensor = sensor(reader)?;
            let has_pose = reader.u8("whether a sensor has a pose")?;
            if has_pose > 1 {
                return Err(reader.error(format!("whether a sensor has a pose is {has_pose}")));
            }
            let pose = (has_pose == 1).then(|| pose(reader)).transpose()?;
            others.push((sensor, pose));
        }
        Ok(Self {
            id,
            reference,
            others,
        })
    }

    fn write(&self, writer: &mut impl FieldWriter) -> Written {
        writer.u32(self.id.0)?;
        let num_sensors = self.reference.map_or(0, |_| 1 + self.others.len());
        writer.u32(u32::try_from(num_sensors).unwrap_or(u32::MAX))?;
        if let Some(reference) = self.reference {
            write_sensor(writer, reference)?;
            for (sensor, pose) in &self.others {
                write_sensor(writer, *sensor)?;
                writer.u8(pose.is_some().into())?;
                if let Some(pose) = pose {
                    write_pose(writer, pose)?;
                }
            }
        }
        writer.end_line()
    }
}

impl Record for RigFrame {
    type Id = FrameId;
    const NAME: &'static str = "frame";
    const HEADER: &'static str = "FRAME_ID, RIG_ID, RIG_FROM_WORLD[QW, QX, QY, QZ, TX, TY, TZ], NUM_DATA_IDS, DATA_IDS[] as (SENSOR_TYPE, SENSOR_ID, DATA_ID)";
    const MIN_BYTES: u64 = 4 + 4 + POSE_BYTES + 4;

    fn id(&self) -> FrameId {
        self.id
    }

    fn read(reader: &mut impl FieldReader, _: Observations) -> Result<Self> {
        let id = FrameId(reader.u32("the number of a frame")?);
        let rig = RigId(reader.u32("the rig of a frame")?);
        let rig_from_world = pose(reader)?;
        let num = reader.short_list("data of a frame", 16)?;
        let mut data = Vec::with_capacity(num);
        for _ in 0..num {
            data.push((sensor(reader)?, reader.u64("the number of a datum")?));
        }
        Ok(Self {
            id,
            rig,
            rig_from_world,
            data,
        })
    }

    fn write(&self, writer: &mut impl FieldWriter) -> Written {
        writer.u32(self.id.0)?;
        writer.u32(self.rig.0)?;
        write_pose(writer, &self.rig_from_world)?;
        writer.u32(u32::try_from(self.data.len()).unwrap_or(u32::MAX))?;
        for (sensor, datum) in &self.data {
            write_sensor(writer, *sensor)?;
            writer.u64(*datum)?;
        }
        writer.end_line()
    }
}

fn vector(reader: &mut impl FieldReader, fields: [&'static str; 3]) -> Result<DVec3> {
    let mut read = |axis: usize| reader.finite(fields[axis]);
    Ok(DVec3::new(read(0)?, read(1)?, read(2)?))
}

fn pose(reader: &mut impl FieldReader) -> Result<Rigid> {
    let w = reader.finite("qw")?;
    let v = vector(reader, ["qx", "qy", "qz"])?;
    let quaternion = DQuat::from_xyzw(v.x, v.y, v.z, w);
    let length = quaternion.length();
    if length < MIN_QUATERNION || !length.is_finite() {
        return Err(reader.error(format!(
            "the quaternion [{w:?}, {:?}, {:?}, {:?}] has no direction",
            v.x, v.y, v.z
        )));
    }
    let rotation = if (length - 1.0).abs() <= QUATERNION_TOLERANCE {
        quaternion
    } else {
        quaternion / length
    };
    Ok(Rigid {
        rotation,
        translation: vector(reader, ["tx", "ty", "tz"])?,
    })
}

fn write_pose(writer: &mut impl FieldWriter, pose: &Rigid) -> Written {
    let (q, t) = (pose.rotation, pose.translation);
    for value in [q.w, q.x, q.y, q.z, t.x, t.y, t.z] {
        writer.f64(value)?;
    }
    Ok(())
}

fn sensor(reader: &mut impl FieldReader) -> Result<SensorId> {
    Ok(SensorId {
        kind: reader.sensor_type()?,
        number: reader.u32("the number of a sensor")?,
    })
}

fn write_sensor(writer: &mut impl FieldWriter, sensor: SensorId) -> Written {
    writer.sensor_type(sensor.kind)?;
    writer.u32(sensor.number)
}
