"""``python -m cutvib_ss.blind.rig``: see `cutvib_ss.blind.rig.bulk`."""

from cutvib_ss.blind.rig.bulk import main

if __name__ == "__main__":
    main()
