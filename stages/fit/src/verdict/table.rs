//! The rules of the verdict: all that makes a fit refused or doubtful, its exemptions, and the
//! sentences that people read. METHOD.md §15 is made from this file by the tests beside it.
//!
//! A fit is refused if a row refuses it, else doubtful if a row doubts it, else trusted. Sentences
//! stand in the order of the rules, those that refuse first and notes last.

use contract::Verdict::{Doubtful, Refused, Trusted};

use super::rule::AlsoAsked::{BeforeReport, Contradicts};
use super::rule::Property::{
    DeterminedJoint, KnownScanners, LastJoint, LinkAside, LinkHeld, OnlyScanners, SlidingJoint,
    TradeOff,
};
use super::rule::Quantity::{
    AgreeingScans, BeyondLimit, DeterminedJoints, HeldJoints, JointOwnSigma, JointPoints,
    KnownButLast, KnownJoints, LinkSeen, LinkViolation, Margin, OtherExplained, Points, Rms, Score,
    Seen, Violation,
};
use super::rule::Subject::{EachJoint, EachLink, Robot};
use super::rule::Test::{Above, AtMost, Below, Is, IsNot};
use super::rule::VerdictChange::{AtLeast, AtMost as NoBetter, Set};
use super::rule::{EventRow, Exemption, RowOutcome, VerdictRow, VerdictRule};
use super::thresholds::{
    AGREEING, AT_ALL, BEYOND_LIMIT, FAR_OFF_SURFACE, FEW_POINTS, HALF, HALF_BUT_LAST,
    JOINT_FEW_POINTS, JOINT_OPEN, LINK_MOST_PIERCED, LINK_PIERCED, LINK_SEEN, LITTLE_SEEN,
    LOW_SCORE, LOW_SCORE_OFF_SURFACE, LOWEST_SCORE, MOST_PIERCED, NONE, OFF_SURFACE,
    OFF_SURFACE_AND_OPEN, OTHER_MODEL, PIERCED, QUARTER, RIVAL_MARGIN,
};

/// A row without exemptions that is asked for the verdict only.
const PLAIN: VerdictRow =
    VerdictRow { outcome: RowOutcome::Note, when: &[], unless: &[], sentence: "", also: &[] };

/// A flange is about where it is, and so is all before it, at each value of the last joint.
const NOT_THE_LAST: Exemption = Exemption {
    case: Is(LastJoint),
    why: "a flange may look the same at every value of the last joint, and a robot stands where \
          it was found whatever that value is",
};

/// What the fit's own evidence says.
pub(super) const RULES: &[VerdictRule] = &[
    VerdictRule {
        name: "score",
        subject: Robot,
        rows: &[
            VerdictRow {
                outcome: RowOutcome::Refused,
                when: &[Below(Score, LOWEST_SCORE)],
                sentence: "its score is only {score}",
                ..PLAIN
            },
            VerdictRow {
                outcome: RowOutcome::Doubtful,
                when: &[Below(Score, LOW_SCORE)],
                sentence: "its score is only {score}",
                also: &[Contradicts],
                ..PLAIN
            },
        ],
    },
    VerdictRule {
        name: "free space",
        subject: Robot,
        rows: &[
            VerdictRow {
                outcome: RowOutcome::Refused,
                when: &[Above(Violation, MOST_PIERCED)],
                sentence: "beams went through {violation} of the judged surface",
                ..PLAIN
            },
            VerdictRow {
                outcome: RowOutcome::Doubtful,
                when: &[Above(Violation, PIERCED)],
                sentence: "beams went through {violation} of the judged surface",
                ..PLAIN
            },
        ],
    },
    VerdictRule {
        name: "free space at a link",
        subject: EachLink,
        rows: &[
            VerdictRow {
                outcome: RowOutcome::Refused,
                when: &[Above(LinkSeen, LINK_SEEN), Above(LinkViolation, LINK_MOST_PIERCED)],
                unless: &[
                    Exemption {
                        case: IsNot(LinkHeld),
                        why: "the link may well stand elsewhere, and the rest of the arm where it \
                              was found",
                    },
                    Exemption {
                        case: Is(LinkAside),
                        why: "where a rod or cylinder of a loop stands that the model does not \
                              describe says nothing against the arm",
                    },
                ],
                sentence: "beams went through {link_violation} of link '{link}'",
                ..PLAIN
            },
            VerdictRow {
                outcome: RowOutcome::Doubtful,
                when: &[
                    Above(LinkSeen, LINK_SEEN),
                    Above(LinkViolation, LINK_PIERCED),
                    Is(LinkAside),
                ],
                sentence: "beams went through {link_violation} of link '{link}': a loop that the \
                           model lacks may move it",
                also: &[Contradicts],
                ..PLAIN
            },
            VerdictRow {
                outcome: RowOutcome::Doubtful,
                when: &[Above(LinkSeen, LINK_SEEN), Above(LinkViolation, LINK_PIERCED)],
                sentence: "beams went through {link_violation} of link '{link}'",
                also: &[Contradicts],
                ..PLAIN
            },
        ],
    },
    VerdictRule {
        name: "points",
        subject: Robot,
        rows: &[VerdictRow {
            outcome: RowOutcome::Refused,
            when: &[Below(Points, FEW_POINTS)],
            sentence: "only {points} on it",
            ..PLAIN
        }],
    },
    VerdictRule {
        name: "surface that was seen",
        subject: Robot,
        rows: &[
            VerdictRow {
                outcome: RowOutcome::Refused,
                when: &[Below(Seen, LITTLE_SEEN), AtMost(HeldJoints, QUARTER)],
                sentence: "only {seen} of the surface was seen",
                ..PLAIN
            },
            VerdictRow {
                outcome: RowOutcome::Doubtful,
                when: &[Below(Seen, LITTLE_SEEN)],
                sentence: "only {seen} of the surface was seen",
                ..PLAIN
            },
        ],
    },
    VerdictRule {
        name: "distance of the points",
        subject: Robot,
        rows: &[
            VerdictRow {
                outcome: RowOutcome::Refused,
                when: &[Above(Rms, FAR_OFF_SURFACE)],
                sentence: OFF,
                also: &[BeforeReport],
                ..PLAIN
            },
            VerdictRow {
                outcome: RowOutcome::Refused,
                when: &[AtMost(HeldJoints, HALF), Above(Rms, OFF_SURFACE_AND_OPEN)],
                sentence: OFF,
                also: &[BeforeReport],
                ..PLAIN
            },
            VerdictRow {
                outcome: RowOutcome::Refused,
                when: &[Above(Rms, OFF_SURFACE), Below(Score, LOW_SCORE_OFF_SURFACE)],
                sentence: OFF,
                ..PLAIN
            },
            VerdictRow {
                outcome: RowOutcome::Doubtful,
                when: &[Above(Rms, OFF_SURFACE)],
                sentence: OFF,
                also: &[Contradicts],
                ..PLAIN
            },
        ],
    },
    VerdictRule {
        name: "scanner positions",
        subject: Robot,
        rows: &[VerdictRow {
            outcome: RowOutcome::Doubtful,
            when: &[IsNot(KnownScanners)],
            sentence: "no scanner position is known, so nothing proves free space",
            ..PLAIN
        }],
    },
    VerdictRule {
        name: "how well a joint is known",
        subject: EachJoint,
        rows: &[
            VerdictRow {
                outcome: RowOutcome::Doubtful,
                when: &[Below(JointPoints, JOINT_FEW_POINTS)],
                unless: &[NOT_THE_LAST],
                sentence: "only {joint_points} on what joint '{joint}' moves",
                ..PLAIN
            },
            VerdictRow {
                outcome: RowOutcome::Doubtful,
                when: &[Above(JointOwnSigma, JOINT_OPEN)],
                unless: &[NOT_THE_LAST],
                sentence: "joint '{joint}' is undetermined (± {own_sigma})",
                ..PLAIN
            },
            VerdictRow {
                outcome: RowOutcome::Note,
                when: &[IsNot(DeterminedJoint)],
                sentence: "joint '{joint}' is {certainty} (± {sigma}){elsewhere}",
                ..PLAIN
            },
        ],
    },
    VerdictRule {
        name: "limits of a joint",
        subject: EachJoint,
        rows: &[
            VerdictRow {
                outcome: RowOutcome::Doubtful,
                when: &[Is(DeterminedJoint), Above(BeyondLimit, BEYOND_LIMIT)],
                sentence: "joint '{joint}' stands beyond its limit",
                ..PLAIN
            },
            VerdictRow {
                outcome: RowOutcome::Doubtful,
                when: &[IsNot(DeterminedJoint), Above(BeyondLimit, AT_ALL)],
                unless: &[
                    NOT_THE_LAST,
                    Exemption {
                        case: Is(SlidingJoint),
                        why: "an electrode that a held part hides may stand anywhere on its slide",
                    },
                ],
                sentence: "joint '{joint}' stands beyond its limit",
                ..PLAIN
            },
        ],
    },
    VerdictRule {
        name: "joints that are known closely",
        subject: Robot,
        rows: &[VerdictRow {
            outcome: RowOutcome::Doubtful,
            when: &[AtMost(DeterminedJoints, NONE)],
            sentence: "the points determine none of its joints closely",
            ..PLAIN
        }],
    },
    VerdictRule {
        name: "joints that are known",
        subject: Robot,
        rows: &[
            VerdictRow {
                outcome: RowOutcome::Refused,
                when: &[Below(KnownButLast, HALF_BUT_LAST)],
                unless: &[Exemption {
                    case: IsNot(OnlyScanners),
                    why: "a depth camera sees half of an arm and bends that, and points without a \
                          scanner may be a camera's: no more can be asked of them",
                }],
                sentence: "only {known_joints} are known",
                ..PLAIN
            },
            VerdictRow {
                outcome: RowOutcome::Doubtful,
                when: &[AtMost(KnownJoints, HALF)],
                sentence: "only {known_joints} are known",
                ..PLAIN
            },
        ],
    },
    VerdictRule {
        name: "unknowns that trade off",
        subject: Robot,
        rows: &[VerdictRow {
            outcome: RowOutcome::Note,
            when: &[Is(TradeOff)],
            sentence: "{trade_off}",
            ..PLAIN
        }],
    },
    VerdictRule {
        name: "another posture",
        subject: Robot,
        rows: &[VerdictRow {
            outcome: RowOutcome::Doubtful,
            when: &[Below(Margin, RIVAL_MARGIN)],
            sentence: "another posture explains the points nearly as well",
            ..PLAIN
        }],
    },
];

/// What is said of points that lie beside the surface.
const OFF: &str = "its points lie {rms} off its surface, where the scans' noise is {noise}";

/// A posture that one of the rows marked `before report` refuses.
pub(super) const LOST: EventRow = EventRow {
    event: "points are too far off before the fit is reported",
    when: &[],
    change: Set(Refused),
    sentence: "",
    why: "all that would still be found out costs time and changes nothing",
};
pub(super) const LINK_AFTER_LINK: EventRow = EventRow {
    event: "the method was that of [1]",
    when: &[],
    change: Set(Doubtful),
    sentence: "the source's method says nothing of how sure it is",
    why: "it has no covariance, and no rule above can be asked",
};
pub(super) const ONE_SCAN: EventRow = EventRow {
    event: "scans contradict one another, and one group of them shows this posture",
    when: &[Below(AgreeingScans, AGREEING)],
    change: NoBetter(Some(Doubtful)),
    sentence: "only one scan shows this posture",
    why: "what a single scan shows may be an error of that scan",
};
pub(super) const RIVAL_MODEL: EventRow = EventRow {
    event: "another model claims the same points",
    when: &[Above(OtherExplained, OTHER_MODEL)],
    change: NoBetter(Some(Doubtful)),
    sentence: "model '{model}' explains the points nearly as well",
    why: "the robot may be of the other model",
};
pub(super) const CALIBRATED: EventRow = EventRow {
    event: "the places of the joints were calibrated",
    when: &[],
    change: NoBetter(None),
    sentence: "",
    why: "a model that may bend to the points must not earn trust that the nominal model, its \
          joints known as well, does not earn: the verdict carried is that of the nominal fit",
};
pub(super) const SEEN_AGAIN: EventRow = EventRow {
    event: "a rescan sees the robot stand as it stood",
    when: &[],
    change: AtLeast(None),
    sentence: "",
    why: "what was known of how it stood counts for how it stands: the verdict carried is the \
          earlier one",
};
pub(super) const GONE: EventRow = EventRow {
    event: "a rescan sees through the place of the robot",
    when: &[],
    change: Set(Refused),
    sentence: "it is gone: the new scans see through it",
    why: "no robot stands there any more",
};
pub(super) const CONTRADICTED: EventRow = EventRow {
    event: "a rescan contradicts the posture and finds no other",
    when: &[],
    change: Set(Doubtful),
    sentence: "the new scans contradict this posture and show no other",
    why: "the robot may still be there",
};
pub(super) const ACCEPTED: EventRow = EventRow {
    event: "a person accepts the robot in a review",
    when: &[],
    change: AtLeast(Some(Trusted)),
    sentence: "accepted in review",
    why: "a person has looked; the sentence stands before those that it overrules",
};

/// What is found out later, in the order of a run.
#[cfg(test)]
pub(super) const EVENTS: &[EventRow] = &[
    LOST,
    LINK_AFTER_LINK,
    ONE_SCAN,
    RIVAL_MODEL,
    CALIBRATED,
    SEEN_AGAIN,
    GONE,
    CONTRADICTED,
    ACCEPTED,
];
