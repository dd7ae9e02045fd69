"""The sealed trial of the diagnosis: campaigns whose causes are withheld, their diagnoses, and the score."""
