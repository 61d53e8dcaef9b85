"""AMASS: many data sets of motion capture as poses of SMPL's bodies."""

from mwlib.data.collections.record import Collection

RECORDS = (
    Collection(
        name="amass",
        title="AMASS, more than 11,000 motions of more than 300 people, 40 hours, as poses of SMPL-H or SMPL-X",
        licence="research use, by registration",
        place="amass",
        acknowledgement="AMASS: Mahmood, Ghorbani, Troje, Pons-Moll and Black, ICCV 2019.",
        steps=(
            "register at https://amass.is.tue.mpg.de; a person has to agree to the licences of its motions",
            "unpack the archives of the data sets that you want, of SMPL+H or of SMPL-X, into one folder; "
            "https://github.com/nghorbani/amass explains them",
            "register for the body model, at https://mano.is.tue.mpg.de (extended SMPL+H model) or https://smpl-x.is.tue.mpg.de, "
            "and put it into the folder body_models beside the motions or in the folder of data: smplh/male/model.npz, "
            "smplx/SMPLX_MALE.npz",
        ),
    ),
)
