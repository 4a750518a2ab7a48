//! Which links of a robot may carry a tool or a part.

use robot::{JointKind, Model};

/// For each link, whether a joint moves it and no link that another joint moves comes after it.
pub(crate) fn hands(model: &Model) -> Vec<bool> {
    let moving = model.moving();
    let mut carries = vec![false; moving.len()];
    for joint in model.joints.iter().rev() {
        let turns = joint.kind != JointKind::Fixed;
        carries[joint.parent] |= carries[joint.child] || turns;
    }
    moving.iter().zip(carries).map(|(moving, carries)| *moving && !carries).collect()
}

/// The links of [`hands`], and the link to which the first of them is joined.
pub(crate) fn wrists(model: &Model) -> Vec<bool> {
    let hands = hands(model);
    let mut wrists = hands.clone();
    for joint in model.joints.iter().filter(|joint| hands[joint.child]) {
        wrists[joint.parent] = true;
    }
    wrists
}
