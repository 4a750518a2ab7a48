//! The loops of real models, as `robot.toml` describes them.

use super::Folder;
use robot::Model;

pub const RPR: &[(&str, &str)] = &[
    ("abb_irb6640_205_275", "urdf = 'robot_loop.urdf'
        [[sub_chain]]
        name = 'balancer'
        kind = 'RPR'
        passive = ['joint_cylinder', 'joint_piston']
        closures = [{ link_a = 'link_piston', xyz_a = [0, -0.194, 0], link_b = 'link_2', xyz_b = [-0.22, -0.194, -0.0673] }]"),
    ("abb_irb7600_150_350", "urdf = 'robot_loop.urdf'
        [[sub_chain]]
        name = 'balancer'
        kind = 'RPR'
        passive = ['balancer_cylinder_joint', 'balancer_rod_joint']
        closures = [{ link_a = 'balancer_rod', xyz_a = [0, -0.2155, 0], link_b = 'link_2', xyz_b = [-0.1385, -0.2155, -0.022] }]"),
    ("fanuc_m900ib_700", "urdf = 'robot_loop.urdf'
        [[sub_chain]]
        name = 'parallelogram'
        kind = 'RRR'
        passive = ['pjoint_1', 'pjoint_2']
        closures = [{ link_a = 'plink_2', xyz_a = [0, 0, -1.12], link_b = 'plink_1', xyz_b = [-0.75, 0.08, 0] }]
        [[sub_chain]]
        name = 'springs'
        kind = 'RPR'
        passive = ['piston_left_joint', 'balancer_left_joint', 'piston_right_joint', 'balancer_right_joint']
        closures = [
          { link_a = 'balancer_left', xyz_a = [0, 0.3957, 0], link_b = 'link_2', xyz_b = [0, 0.3957, 1.12] },
          { link_a = 'balancer_right', xyz_a = [0, -0.3957, 0], link_b = 'link_2', xyz_b = [0, -0.3957, 1.12] },
        ]"),
    ("fanuc_r2000ic_165f", "urdf = 'robot_loop.urdf'
        [[sub_chain]]
        name = 'balancer'
        passive = ['balancer_cylinder_joint', 'balancer_rod_joint']
        closures = [{ link_a = 'balancer_rod', xyz_a = [0, 0, 0], link_b = 'J2_link', xyz_b = [-0.2142, 0.189, -0.0176] }]"),
    ("yaskawa_es165", "urdf = 'robot_loop.urdf'
        [[sub_chain]]
        name = 'balancer'
        passive = ['joint_balancer_piston', 'joint_balancer_rod']
        closures = [{ link_a = 'balancer_rod', xyz_a = [0, -0.19, 0], link_b = 'link_l', xyz_b = [0.126187, -0.19, 0.180213] }]"),
];

pub const RRR: &[(&str, &str)] = &[
    ("abb_irb2400_12_155", "[[sub_chain]]
        name = 'parallelogram'
        kind = 'RRR'
        passive = ['joint_lever_a', 'joint_lever_b']
        closures = [{ link_a = 'link_lever_b', xyz_a = [0, -0.06, -0.705], link_b = 'link_lever_a', xyz_b = [-0.18, -0.06, 0] }]"),
    ("robotiq_2f_85", "[[sub_chain]]
        name = 'fingers'
        kind = 'RRR'
        passive = ['left_inner_knuckle_joint', 'left_inner_finger_joint', 'right_inner_knuckle_joint', 'right_inner_finger_joint']
        closures = [
          { link_a = 'left_inner_knuckle', xyz_a = [0, 0.0372, 0.0435], link_b = 'left_inner_finger', xyz_b = [0, -0.018, 0.0065] },
          { link_a = 'right_inner_knuckle', xyz_a = [0, 0.0372, 0.0435], link_b = 'right_inner_finger', xyz_b = [0, -0.018, 0.0065] },
        ]"),
];

/// Loads a shared model with this `robot.toml`.
pub fn looped(name: &str, sheet: &str) -> Option<Model> {
    let (model, findings) = Folder::of(name)?.with("robot.toml", sheet).load();
    for f in findings {
        println!("{f:?}");
    }
    Some(model)
}
